"""One sampler in every host: the same inputs, the same answers."""
