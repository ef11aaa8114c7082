# %% [markdown]
# # Hair that varies
#
# Real hair differs from strand to strand. `cuticle.family` takes every parameter as an argument, draws exactly and fits
# nothing ([family](../family.md)).

# %%
import matplotlib.pyplot as plt
import numpy as np

import cuticle

rng = np.random.default_rng(1)
chiang = cuticle.family("chiang")
melanin = rng.lognormal(0, 0.5, 20_000)  # a strand each
roughness = np.clip(rng.normal(0.3, 0.06, melanin.size), 0.1, 1)
s = chiang.sample(0.2, rng.random((melanin.size, 3)), eumelanin=melanin, beta_m=roughness, beta_n=0.3)
f, pdf = chiang.eval_pdf(s.theta_i, 0.2, s.phi, eumelanin=melanin, beta_m=roughness, beta_n=0.3)
weight = f * np.cos(s.theta_i)[:, None] / pdf[:, None]
luminance = weight @ [0.2126, 0.7152, 0.0722]

# %% [markdown]
# The density is the luminance of f cos, so that a strand's weights all have the luminance of its albedo: what varies below
# is the hair, not noise.

# %%
figure, axes = plt.subplots(figsize=(7, 3.2), layout="constrained")
axes.scatter(melanin, luminance, s=1, c=np.clip(weight, 0, 1))
axes.set(xlabel="melanin", ylabel="weight of one sample (luminance)", xlim=(0, 4))
plt.show()

# %% [markdown]
# Among other strands light is dual scattering's. The strands around are of a mean fibre; the one that is seen is any.

# %%
mean = cuticle.Chiang(beta_m=0.3, beta_n=0.3, eumelanin=1.0)
hair = cuticle.family("dual_scattering", among=mean)
for n in (0, 1, 2, 4):
    s = hair.sample(0.2, rng.random((20_000, 3)), eumelanin=[0.3], strands=n)
    f = hair.eval(s.theta_i, 0.2, s.phi, eumelanin=0.3, strands=n)
    energy = (f * np.cos(s.theta_i)[:, None] / s.pdf[:, None]).mean(0)
    print(f"a light strand through {n} others sends on {energy.round(4)}")

# %% [markdown]
# A groom carries such values, and renders with them ([grooms](../grooms.md), [mitsuba](../mitsuba.md#hair-that-varies)).

# %%
from cuticle.grooms.procedural import hair_ball  # noqa: E402
from cuticle.grooms.variation import vary  # noqa: E402

groom = vary(hair_ball(2000), melanin=0.5, strays=0.02, root_darkening=0.4)
print(groom, {name: values.shape for name, values in groom.attributes.items()})
