"""Plugins for Mitsuba 3: the BSDF `cuticle`, the texture `cuticle_strands` and the integrator `dual_scattering`.

Importing this module registers them.

The plugins are compiled from the core's headers. Python prepares what they read: the tables of the scattering function and
the fitted lobes. docs/mitsuba.md lists every parameter.

Examples
--------
>>> import mitsuba as mi  # doctest: +SKIP
>>> mi.set_variant("scalar_rgb")  # doctest: +SKIP
>>> import cuticle.mitsuba  # doctest: +SKIP
>>> bsdf = mi.load_dict({"type": "cuticle", "fibre": "brown"})  # doctest: +SKIP
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from cuticle import _core
from cuticle._support import validate
from cuticle._support.backends import check_backend
from cuticle._support.extras import needed
from cuticle.fitting.samplings import OWN

__all__ = ["MITSUBA_VERSION", "VARIANTS", "Material", "build", "read_material", "register", "strand_texture"]

MITSUBA_VERSION = "3.9.1"  # plugins compiled against one version load in no other
VARIANTS = ("scalar_rgb", "scalar_spectral", "llvm_ad_rgb", "llvm_ad_spectral", "cuda_ad_rgb", "cuda_ad_spectral")

with needed("cuticle.mitsuba"):
    import mitsuba as mi

from cuticle.mitsuba.build import build  # noqa: E402 - where Mitsuba is absent, its own message
from cuticle.mitsuba.material import Material, material_of, read_material  # noqa: E402
from cuticle.mitsuba.parameters import Parameters  # noqa: E402
from cuticle.mitsuba.strand_values import make_texture, strand_texture  # noqa: E402
from cuticle.mitsuba.textures import mean_of, refuse_mesh, textures_of  # noqa: E402


def plugin_folder() -> Path:
    """Return the folder whose `plugins` holds the compiled plugins."""
    return Path(_core.__file__).parent


def register() -> None:
    """Register `cuticle`, `cuticle_strands` and `dual_scattering` with Mitsuba, in every variant that they are compiled for.

    Importing the module calls this function. Calling it again is harmless.

    Raises
    ------
    RuntimeError
        Mitsuba has another version, or the package was built without the plugins.
    """
    if mi.__version__ != MITSUBA_VERSION:
        raise RuntimeError(
            f"the plugins are compiled for Mitsuba {MITSUBA_VERSION}, this is {mi.__version__}:"
            f" pip install mitsuba=={MITSUBA_VERSION}"
        )
    folder = plugin_folder()
    if not list((folder / "plugins").glob("cuticle_bsdf.*")):
        raise RuntimeError(
            f"this cuticle was built without its Mitsuba plugins (none in {folder / 'plugins'}):"
            f" install it again where Mitsuba {MITSUBA_VERSION} can be installed"
        )
    mi.detail.remove_variant_callback(_register_in)
    mi.detail.add_variant_callback(_register_in)
    _register_in(None, mi.variant())


def _register_in(_: str | None, variant: str | None) -> None:
    if variant not in VARIANTS:
        return
    resolver = mi.file_resolver()
    if str(plugin_folder()) not in [str(resolver[k]) for k in range(len(resolver))]:
        resolver.append(str(plugin_folder()))
    mi.register_bsdf("cuticle", partial(_core.in_one_line, _make_bsdf))
    mi.register_texture("cuticle_strands", partial(_core.in_one_line, _make_texture))


def _make_texture(props: Any) -> Any:
    check_variant()
    return make_texture(props)


def check_variant() -> None:
    """Raise RuntimeError if the current variant cannot run here, before Dr.Jit aborts the process."""
    variant = mi.variant()
    if variant not in VARIANTS:
        raise RuntimeError(f"the plugins are compiled for {', '.join(VARIANTS)}; the variant is {variant}")
    check_backend(variant)


def _make_bsdf(props: Any) -> Any:
    check_variant()
    given = {name: props[name] for name in props.keys()}  # noqa: SIM118 - Mitsuba's, not a dict
    scale, tables = given.pop("scale", None), given.pop("strand_tables", None)
    textures = textures_of(props, given)
    refuse_mesh("scale", scale)
    if isinstance(scale, (int, float)):
        validate.number("scale", scale, 0, 1e9, remedy="it multiplies the absorption")
    given |= {name: mean_of(name, texture) for name, texture in textures.items()}  # which stands for it
    asked = Parameters(**given)
    material = material_of(asked, textures, scaled=scale is not None)
    # Files as they are found now: beside the scene's file, while it is loaded. Another sampling would be another plugin.
    found = {name: path for name in ("fibre", "filename") if (path := getattr(asked, name)) is not None}
    scene = given | found | ({} if material.near else {"sampling": OWN if material.own else asked.sampling or "lobes"})
    return build(material, scale=scale, textures=textures, scene=scene, tables=tables)


register()
