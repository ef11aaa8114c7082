# %% [markdown]
# # Audit the sampler you ship
#
# An audit asks of any sampler: does `pdf` tell the density of what `sample` draws? It needs two functions and nothing of how
# they work. Here they are NumPy's; [audit](../audit.md) has the ways for C++, for files of samples, and for Mitsuba.
#
# Our subjects are an exact sampler of Chiang's fibres, and the same with a slip: it turns φ by six degrees.

# %%
import numpy as np

import cuticle

fibre = cuticle.Chiang(beta_m=0.3, beta_n=0.3, eumelanin=1.3)
right = cuticle.family("chiang").sampler_at(fibre)


def slipped(theta_r, u):
    s = right.sample(theta_r, u)
    phi = s.phi + 0.1
    return s.theta_i, phi, right.pdf(s.theta_i, theta_r, phi)


audit = cuticle.audit(right.sample, right.pdf, theta_r=np.radians([0, 60]), samples=200_000)
print(audit)
assert audit.ok

# %% [markdown]
# The right one passes. The other fails; the audit says in which test, and where.

# %%
wrong = cuticle.audit(slipped, right.pdf, theta_r=np.radians([0, 60]), samples=200_000)
print(wrong)
assert not wrong.ok

# %% [markdown]
# A smaller slip needs more samples: .4 % in θ. However many there are, `level` is the false-positive rate of all tests of an
# audit together.


# %%
def slightly(theta_r, u):
    s = right.sample(theta_r, u)
    theta_i = s.theta_i * 0.996
    return theta_i, s.phi, right.pdf(theta_i, theta_r, s.phi)


for samples in (10_000, 1_000_000):
    found = cuticle.audit(slightly, right.pdf, theta_r=[0.5], samples=samples)
    print(f"{samples:,} samples: {'passes' if found.ok else 'fails'}")
