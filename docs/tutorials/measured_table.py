# %% [markdown]
# # From a measured table to a renderer
#
# You have values of a scattering function on a grid, measured or simulated, and no formula. Cuticle reads them, fits a
# sampler and writes both for a renderer.
#
# The table here is of a fibre that we know, with 5 % of noise put on it, so that we can say how far off it ends.

# %%
import numpy as np

import cuticle

truth = cuticle.Chiang(beta_m=0.3, beta_n=0.35, eumelanin=0.9)
viewers = np.radians(np.linspace(-75, 75, 11))
theta, phi = np.radians(np.linspace(-88, 88, 89)), np.radians(np.linspace(0, 180, 61))
values = np.stack([truth.eval(theta[:, None], float(t), phi) for t in viewers])
values *= 1 + 0.05 * np.random.default_rng(1).normal(size=values.shape)
print("viewers, theta_i, phi, channels:", values.shape)

# %% [markdown]
# `Tabulated` keeps the values, and fills what lies between them. Its file is `.npz` or CSV ([sources](../sources.md)).

# %%
table = cuticle.Tabulated(viewers, theta, phi, values, even=True)
print(table)
q = cuticle.measure(cuticle.fit(truth, 4).sampler, table, 0.3)
print(f"a sampler of the truth has an ESS of {q.ess:.3f} on the noisy table")

# %% [markdown]
# Fit, and measure on the truth: the noise should not be learnt.

# %%
fit = cuticle.fit(table, 4)
for t in (-0.9, 0.0, 0.9):
    print(f"theta_r {t:+.1f}: ESS on the truth {cuticle.measure(fit.sampler, truth, t).ess:.3f}")

# %% [markdown]
# Write it. The scattering function goes along as a table, thinned until f is within 1 % of its integral. Noise in it counts
# as f, so that the file of a noisy table is large: average your measurement before, or write the sampler alone.

# %%
from cuticle.export import export  # noqa: E402

made = export(fit.sampler, "cpp", frame="mitsuba", name="measured", with_model=True, model=table)
alone = export(fit.sampler, "cpp", frame="mitsuba", name="measured")
print(f"{len(made.text):,} characters, {len(alone.text):,} without f; f is within {100 * made.model.error:.2f} %")
