"""Whether a variant of Mitsuba runs here: Dr.Jit ends the process with an LLVM that is too old."""

from __future__ import annotations

LLVM_NEEDED = 19  # Dr.Jit 1.5 aborts with 14, 15 and 16


def llvm_version() -> tuple[int, ...] | None:
    """Return the version of the LLVM that Dr.Jit finds, or None; Mitsuba has to be installed."""
    import drjit as dr

    if not dr.has_backend(dr.JitBackend.LLVM):
        return None
    return tuple(dr.detail.llvm_version())


def has_llvm() -> bool:
    """Whether Dr.Jit finds an LLVM that it works with."""
    found = llvm_version()
    return found is not None and found[0] >= LLVM_NEEDED


def check_backend(variant: str) -> None:
    """Raise RuntimeError with the remedy where a variant of Mitsuba would not run here, before it is set."""
    if variant.startswith("llvm"):
        _check_llvm(variant)
    elif variant.startswith("cuda"):
        import drjit as dr

        if not dr.has_backend(dr.JitBackend.CUDA):
            raise RuntimeError(
                f"{variant} needs an NVIDIA GPU and its driver, and none is found: scalar_rgb and llvm_ad_rgb run without"
            )


def _check_llvm(variant: str) -> None:
    remedy = (
        f"install LLVM {LLVM_NEEDED} or newer (Debian: libllvm19; PyPI: karellen-llvm-core), and name its libLLVM in"
        " DRJIT_LIBLLVM_PATH before Python starts; scalar_rgb needs none"
    )
    found = llvm_version()
    if found is None:
        raise RuntimeError(f"{variant} needs LLVM and none is found: {remedy}")
    if found[0] < LLVM_NEEDED:
        raise RuntimeError(f"{variant} would abort with LLVM {'.'.join(map(str, found))}: {remedy}")
