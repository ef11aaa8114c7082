"""The sampler's own file, for hosts that read tables themselves."""

from __future__ import annotations

from cuticle.export.registry import Export, Host, Job


def write(job: Job) -> Export:
    """Return the sampler's file."""
    size = job.sampler.nodes.size * 4 + job.sampler.energy.size * 4
    return Export(job.sampler.to_json(), size)


HOST = Host("the sampler's file", write, model="never", named=False, framed=False)
