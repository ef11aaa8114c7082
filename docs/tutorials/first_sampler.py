# %% [markdown]
# # Your first sampler
#
# From a fibre's parameters to samples whose density is known exactly, and a C++ file for a renderer. It takes a minute.
#
# A renderer that shades hair knows the viewer's inclination θ_r and asks for a direction toward the light, (θ_i, φ), drawn
# in proportion to the scattering function f times cos θ_i. Angles are radians.

# %%
import matplotlib.pyplot as plt
import numpy as np

import cuticle

fibre = cuticle.Fibre.preset("brown")
model = cuticle.Marschner(fibre, "energy_conserving")
fit = cuticle.fit(model, 4)
sampler = fit.sampler
print(f"ESS over viewers: mean {fit.ess.mean():.4f}, worst {fit.ess.min():.4f}")

# %% [markdown]
# ESS is the effective sample size: 1 where the density is f cos θ_i itself, so that only light adds noise.
#
# Draw, and look: dots are samples, colour is f cos θ_i in green.

# %%
theta_r = 0.3
u = np.random.default_rng(1).random((2000, 3))
drawn = sampler.sample(theta_r, u)
theta, phi = np.linspace(-np.pi / 2, np.pi / 2, 181), np.linspace(-np.pi, np.pi, 361)
f = model.eval(theta[:, None], theta_r, phi)[..., 1] * np.cos(theta)[:, None]
figure, axes = plt.subplots(figsize=(7, 3.4), layout="constrained")
axes.pcolormesh(np.degrees(phi), np.degrees(theta), f, cmap="YlOrBr_r")
turn = np.angle(np.exp(1j * drawn.phi))  # within half a turn
axes.plot(np.degrees(turn), np.degrees(drawn.theta_i), "k.", markersize=1)
axes.set(xlabel="φ, degrees", ylabel="θ_i, degrees")
plt.show()

# %% [markdown]
# A sample's weight is f cos θ_i over its density; their mean is the energy that the fibre scatters.

# %%
f = model.eval(drawn.theta_i, theta_r, drawn.phi)
weight = f * (np.cos(drawn.theta_i) / drawn.pdf)[:, None]
print("albedo", weight.mean(0).round(3))
print("deviation of the green weight", weight[:, 1].std().round(3))

# %% [markdown]
# Is it right? A check draws a million samples for each of nine viewers; a tenth of them does here.

# %%
report = cuticle.check(sampler, model, samples=100_000)
print(report)
assert report.ok

# %% [markdown]
# For a renderer, one file without dependencies; `with_model=True` puts f in, too.

# %%
from cuticle.export import export  # noqa: E402

made = export(sampler, "cpp", frame="pbrt", name="brown")
print(f"{len(made.text):,} characters; the table has {made.table_bytes:,} bytes")
print("\n".join(line for line in made.text.splitlines()[:30]))
