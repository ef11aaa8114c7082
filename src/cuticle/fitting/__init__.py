"""From a scattering function to a sampler."""
