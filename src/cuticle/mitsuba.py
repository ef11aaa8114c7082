"""Mitsuba 3: the BSDF `cuticle` and the integrator `dual_scattering`. Importing this module registers them.

Python prepares what the plugins read, the fibre's tables and the fitted lobes; the plugins themselves are compiled from
the core's headers. docs/mitsuba.md lists every parameter.

Examples
--------
>>> import mitsuba as mi  # doctest: +SKIP
>>> mi.set_variant("scalar_rgb")  # doctest: +SKIP
>>> import cuticle.mitsuba  # doctest: +SKIP
>>> bsdf = mi.load_dict({"type": "cuticle", "fibre": "brown"})  # doctest: +SKIP
"""

from __future__ import annotations

import math
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cuticle import _core, validate
from cuticle.combine import combine
from cuticle.document import find_functions, highlight_axis, table_2, table_3
from cuticle.fibre import Fibre
from cuticle.fit import DRAFT, DocumentFunctions, fit
from cuticle.llvm import check_llvm
from cuticle.lobe_table import MAX_LOBES, SIGMA_PHI, SIGMA_THETA
from cuticle.models import AVERAGE_LIMIT, LONGITUDINAL_OF, DualScattering, Marschner
from cuticle.presets import PRESETS, read_fibre
from cuticle.render.scene import SAMPLINGS
from cuticle.sampler import Sampler

__all__ = ["MITSUBA_VERSION", "VARIANTS", "Material", "register"]

MITSUBA_VERSION = "3.9.1"  # plugins are compiled against this one and fit no other
VARIANTS = ("scalar_rgb", "scalar_spectral", "llvm_ad_rgb", "llvm_ad_spectral", "cuda_ad_rgb", "cuda_ad_spectral")

# Where a spectrum of three values turns from blue to green and from green to red, nm.
PRIMARY_EDGES = (453.5, 512.9, 587.6, 598.4)

_SIZES = (4, 8, 16, 32)  # numbers of lobes that the plugin is compiled for
_RATIO = 1.3  # between neighbouring absorptions of the tables
_REACH = 8.0  # how far beyond the fibre's own absorption they go, either way
_PARAMETERS = ("fibre", "filename", "sampling", "lobes", "direct_share", "scale")


try:
    import mitsuba as mi
except ImportError as error:
    raise ImportError(
        f"cuticle.mitsuba needs Mitsuba {MITSUBA_VERSION}, which is not here ({error}): pip install 'cuticle[mitsuba]'"
    ) from None


class Material(NamedTuple):
    """What a BSDF `cuticle` is made of."""

    fibre: Fibre
    single: Sampler | None  # of a strand on its own; None: the uniform sphere
    combined: Sampler | None  # of a strand among others, whatever lies between it and the light


def plugin_folder() -> Path:
    """Return the folder whose `plugins` holds the compiled plugins."""
    return Path(_core.__file__).parent


def register() -> None:
    """Make `cuticle` and `dual_scattering` known to Mitsuba, in every variant they are compiled for.

    Importing the module calls it; it may be called again at any time.

    Raises
    ------
    RuntimeError
        Another version of Mitsuba, or a package that was built without the plugins.
    """
    if mi.__version__ != MITSUBA_VERSION:
        raise RuntimeError(
            f"the plugins are compiled for Mitsuba {MITSUBA_VERSION} and fit no other, this is {mi.__version__}:"
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
    if str(plugin_folder()) not in str(resolver):
        resolver.append(str(plugin_folder()))
    mi.register_bsdf("cuticle", partial(_core.in_one_line, _make_bsdf))


def check_variant() -> None:
    """Raise RuntimeError where the current variant cannot run here, before Dr.Jit aborts the process."""
    variant = mi.variant()
    if variant not in VARIANTS:
        raise RuntimeError(f"the plugins are compiled for {', '.join(VARIANTS)}; the variant is {variant}")
    check_llvm(variant)


def _make_bsdf(props: Any) -> Any:
    check_variant()
    given = {name: props[name] for name in props.keys()}  # noqa: SIM118 - Mitsuba's, not a dict
    scale = given.pop("scale", None)
    material = read_material(given)
    return build(material, scale=scale)


def read_material(given: dict[str, Any]) -> Material:
    """Return the fibre and the samplers that a plugin's parameters ask for.

    Raises
    ------
    ValueError
        One line: the parameter, what it may be, what came.
    """
    known = (*_PARAMETERS, *Fibre.model_fields)
    for name in given:
        if name not in known:
            raise ValueError(f"cuticle has no parameter {name!r}; it has {', '.join(_PARAMETERS)}, or a fibre's own")
    sampling = validate.choice("sampling", given.get("sampling", "lobes"), SAMPLINGS)
    lobes = validate.integer("lobes", given.get("lobes", 4), 1, MAX_LOBES // 2)
    share = validate.number("direct_share", given.get("direct_share", 0.5), 0.01, 0.99)
    loaded = Sampler.load(_resolve(given["filename"])) if "filename" in given else None
    fibre = _read_fibre(given, loaded)
    if sampling == "uniform":
        return Material(fibre, None, None)
    if loaded is not None and sampling == "lobes":
        return Material(fibre, *_rows(loaded, share))
    return Material(fibre, *_samplers(fibre, lobes, sampling, share))


def _resolve(name: Any) -> str:
    """A file's path as Mitsuba finds it: beside the scene, too."""
    return str(mi.file_resolver().resolve(str(name)))


def _read_fibre(given: dict[str, Any], loaded: Sampler | None) -> Fibre:
    own = {name: _plain(value) for name, value in given.items() if name in Fibre.model_fields}
    name = given.get("fibre")
    if name is not None:
        fibre = read_fibre(str(name) if name in PRESETS else _resolve(name))
    elif loaded is not None:
        if loaded.fibre is None:
            raise ValueError(f"{given['filename']} does not say which fibre it is for: give fibre, too")
        fibre = loaded.fibre
    elif own:
        fibre = Fibre(**own)
    else:
        raise ValueError(f"cuticle needs a fibre: fibre ({', '.join(PRESETS)} or a TOML file), filename, or sigma_a")
    if fibre.formulation == "exact":
        # These stand for gaps between strands. Here strands are counted, gaps and all: 0.7 would take them off twice.
        own = {"d_f": 1.0, "d_b": 1.0, **own}
    if own:
        fibre = fibre.replace(**own)
    if fibre.channels not in (1, 3):
        raise ValueError(f"sigma_a must have 1 or 3 channels (linear RGB) in a render, got {fibre.channels}")
    return fibre


def _rows(sampler: Sampler, share: float) -> tuple[Sampler, Sampler]:
    """What a sampler from a file serves: its row for no strands, and the mixture with the row nearest to 2 strands."""
    single = sampler.row(0.0) if 0 in sampler.strands else sampler.row(sampler.strands[0])
    several = [n for n in sampler.strands if n > 0]
    if not several:
        return single, single
    return single, combine(single, sampler, share, strands=min(several, key=lambda n: abs(n - 2)))


@lru_cache(maxsize=16)
def _samplers(fibre: Fibre, lobes: int, form: str, share: float) -> tuple[Sampler, Sampler | None]:
    model = _among_others(fibre)
    if form == "document":
        if model is None:
            raise ValueError("sampling document needs a fibre whose multiple scattering has a sum: raise sigma_a")
        both = fit(model, strands=(0, 2), form="document", functions=_document_functions(model)).sampler
        return both.row(0.0), combine(both, both, share, strands=2)
    single = fit(_alone(fibre), lobes).sampler
    if model is None:
        return single, None
    both = fit(model, lobes, strands=(0, 2)).sampler
    return single, combine(both, both, share, strands=2)


def _document_functions(model: DualScattering) -> DocumentFunctions:
    """The draft's functions as found for this fibre, or the draft's own numbers where no Gaussian describes it."""
    try:
        return find_functions(table_2(model), table_3(model), highlight_axis(model)).functions
    except ValueError:
        return DRAFT


def _alone(fibre: Fibre) -> Marschner:
    return Marschner(fibre, LONGITUDINAL_OF[fibre.formulation])


def _among_others(fibre: Fibre) -> DualScattering | None:
    """The fibre among strands; None where light that is never absorbed leaves multiple scattering without a sum."""
    try:
        return DualScattering(fibre)
    except ValueError:
        return None


def _plain(value: Any) -> Any:
    """A plugin's parameter as a fibre takes it: colours and vectors become lists."""
    return value if isinstance(value, (str, int, float)) else [float(x) for x in value]


class _Tables(NamedTuple):
    absorption: tuple[float, ...]  # one a column: the fibre's own, then the range
    low: float
    model: DualScattering | None
    single: Marschner


@lru_cache(maxsize=8)
def _tables(fibre: Fibre) -> _Tables:
    own = fibre.absorption
    positive = [x for x in own if x > 0] or [0.1]
    high = min(max(positive) * _REACH, 500.0)
    low = max(min(positive) / _REACH, high / _RATIO ** (31 - len(own)))
    with_others = _among_others(fibre) is not None
    while True:
        steps = math.ceil(math.log(high / low, _RATIO)) + 1
        absorption = (*own, *(low * _RATIO**k for k in range(max(steps, 2))))
        wide = fibre.replace(sigma_a=absorption)
        model = _among_others(wide) if with_others else None
        if model is not None or not with_others:
            return _Tables(absorption, low, model, _alone(wide))
        # As printed, little absorption leaves multiple scattering without a sum: the range begins above that.
        low *= _RATIO


def build(material: Material, *, scale: Any = None) -> Any:
    """Return Mitsuba's BSDF for a material; `scale`, a number or a texture, multiplies the absorption."""
    fibre = material.fibre
    tables = _tables(fibre)
    props = mi.Properties("cuticle_bsdf")
    for name, radians in (("alpha", fibre.alpha), ("beta", fibre.beta)):
        props[name] = mi.ScalarVector3d(*radians)
    props["exact"] = fibre.formulation == "exact"
    for name in ("d_f", "d_b"):
        props[name] = getattr(fibre, name)
    props["limit"] = float(AVERAGE_LIMIT)
    props["exact_channels"] = fibre.channels
    props["sigma_a_low"] = tables.low
    props["sigma_a_ratio"] = _RATIO
    props["direct"] = _tensor(tables.single.tables.direct)
    if tables.model is not None:
        props["spread"] = _tensor(tables.model.single.tables.spread)
        props["averages"] = _tensor(tables.model.average_table)
    for name, sampler in (("single", material.single), ("combined", material.combined)):
        if sampler is not None:
            props[name] = _tensor(_padded(sampler))
            props[f"{name}_even"] = sampler.even
    props["sigma_a"] = _absorption(fibre)
    if scale is not None:
        props["scale"] = scale
    props["about"] = _describe(material)
    return mi.PluginManager.instance().create_object(props)


def _absorption(fibre: Fibre) -> Any:
    """The absorption as Mitsuba takes it: a number, a colour or, in spectral variants, a spectrum.

    Mitsuba would make a smooth spectrum of a colour, which leaves dark hair with too much blue: what is seen is
    exp(-sigma_a), not sigma_a. One value a primary, between PRIMARY_EDGES, gives the colour back
    (benchmarks/spectrum.py).
    """
    if fibre.channels == 1:
        return fibre.absorption[0]
    if mi.is_rgb:
        return mi.ScalarColor3d(*fibre.absorption)
    red, green, blue = fibre.absorption
    values = (blue, blue, green, green, red, red)
    wavelengths = (360.0, *PRIMARY_EDGES, 830.0)
    return mi.load_dict(
        {"type": "irregular", "wavelengths": ", ".join(map(str, wavelengths)), "values": ", ".join(map(str, values))}
    )


def _tensor(values: NDArray[np.float64]) -> Any:
    return mi.TensorXf(np.ascontiguousarray(values, np.float32))


def _padded(sampler: Sampler) -> NDArray[np.float64]:
    """The one row of a sampler as (theta nodes, 5, K), K rounded up by lobes of weight 0."""
    nodes = sampler.nodes[0]
    size = next(k for k in _SIZES if k >= sampler.lobes)
    out = np.zeros((*nodes.shape[:2], size))
    out[:, [SIGMA_THETA, SIGMA_PHI], :] = 1
    out[:, :, : sampler.lobes] = nodes
    return out


def _describe(material: Material) -> str:
    def text(name: str, sampler: Sampler | None) -> str:
        if sampler is None:
            return f"{name} = uniform sphere"
        form = sampler.about.get("form", "lobes")
        return f"{name} = {form}, {sampler.lobes} lobes, {sampler.nodes.shape[1]} nodes in theta_r"

    fibre = ", ".join(f"{k}={v}" for k, v in material.fibre.model_dump(exclude_none=True).items())
    lines = [f"fibre = [{fibre}]", text("sampling", material.single)]
    if material.combined is not None:
        lines.append(text("sampling among strands", material.combined))
    return ",\n".join(lines)


register()
