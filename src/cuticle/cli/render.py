"""`cuticle render`: a groom, rendered; `cuticle render compare`: the same with every sampling."""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from cuticle._support import validate
from cuticle._support.files import check_directory, check_file, filling
from cuticle.cli.tables import table
from cuticle.cli.terminal import JsonOption, out, progress_bar, refuse_idle, was_given
from cuticle.fitting.samplings import SAMPLINGS
from cuticle.grooms.bust import Bust
from cuticle.grooms.groom import MAX_FOLLOWERS, MAX_STRANDS, Groom, join_grooms, read_groom
from cuticle.grooms.procedural import hair_ball, hair_head, head_bust, wavy_lock
from cuticle.grooms.readers import known_formats
from cuticle.grooms.variation import vary
from cuticle.render.scene import INTEGRATORS, LIGHTS, Light, View, bsdf, bust_shape, integrator, load_scene, mitsuba, varies
from cuticle.sampling.sampler import Sampler
from cuticle.scattering.any_fibre import FORMS
from cuticle.scattering.by_name import read_parameters_or_model
from cuticle.scattering.chiang import Chiang

VARIATIONS = tuple(inspect.signature(vary).parameters)[1:]
BUILT_IN: dict[str, Callable[[], Groom]] = {"head": hair_head, "ball": hair_ball, "lock": wavy_lock}


class _PictureFirst(TyperGroup):
    """`render GROOM` is `render picture GROOM`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        if args and args[0] not in (*self.commands, "--help"):
            args = ["picture", *args]
        return super().parse_args(ctx, args)


app = typer.Typer(
    cls=_PictureFirst,
    help="Render a groom with Mitsuba: `cuticle render GROOM -o picture.png`, with the options of `picture`.",
    no_args_is_help=True,
)

GroomArgument = Annotated[
    list[str],
    typer.Argument(
        metavar="GROOM…",
        help=f"Hair files, joined into one groom: {known_formats()}. Or a built-in groom: {', '.join(BUILT_IN)}.",
    ),
]
FibreOption = Annotated[
    str, typer.Option(metavar="PRESET|FILE", help="A preset, a TOML file, a table (.npz, .csv) or a sampler's JSON file.")
]
LightOption = Annotated[str, typer.Option(help=" | ".join(LIGHTS))]
RadiusOption = Annotated[
    float | None, typer.Option(help="Radius of all strands, in the file's unit. Default: the file's own.")
]
TipOption = Annotated[float | None, typer.Option(help="Radius at the tip; --radius is then that at the root.")]
FrameOption = Annotated[
    float | None, typer.Option(help="When to read USD (time code) or Alembic (seconds). Default: the first.")
]
FollowersOption = Annotated[int, typer.Option(help="Number of copies beside each strand, for grooms that hold guides only.")]
SpreadOption = Annotated[
    float | None, typer.Option(help="Standard deviation of a copy's offset. Default: 1/200 of the groom's size.")
]
IgnoreOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME", help="Leave out an attribute of the files that would set the fibre, such as color. Repeatable."
    ),
]
WidthOption = Annotated[int, typer.Option(help="Width in pixels.")]
AzimuthOption = Annotated[float, typer.Option(help="Direction of the camera around the up axis +y, degrees from +z.")]
ElevationOption = Annotated[float, typer.Option(help="Elevation of the camera above the horizon, degrees.")]
ZoomOption = Annotated[float, typer.Option(help="Magnification; 1 fits the whole groom.")]
VariantOption = Annotated[str, typer.Option(help="Mitsuba variant.")]


def _check_groom(ctx: typer.Context, radius: float | None, tip: float | None, followers: int, spread: float | None) -> None:
    if tip is not None and radius is None:
        raise ValueError("--tip needs --radius, the radius at the root")
    if radius is not None:
        validate.number("--radius", radius, 0, 1e6, above=True)
    if tip is not None:
        validate.number("--tip", tip, 0, 1e6)
    if not validate.integer("--followers", followers, 0, MAX_FOLLOWERS):
        refuse_idle(ctx, "without --followers", "spread")
    if spread is not None:
        validate.number("--spread", spread, 0, 1e6)


def _groom(
    names: list[str],
    radius: float | None,
    tip: float | None,
    followers: int,
    spread: float | None,
    frame: float | None,
    ignore: list[str],
) -> Groom:
    if frame is not None and all(n in BUILT_IN for n in names):
        raise ValueError("--frame is the time to read USD or Alembic at; a built-in groom has none, leave it out")
    grooms = [BUILT_IN[n]() if n in BUILT_IN else read_groom(n, radius=radius, frame=frame) for n in names]
    groom = join_grooms(grooms) if len(grooms) > 1 else grooms[0]
    if unknown := [name for name in ignore if name not in groom.attributes]:
        raise ValueError(f"--ignore {unknown[0]}: the groom has {', '.join(groom.attributes) or 'no attributes'}")
    groom = groom.with_attributes(**dict.fromkeys(ignore))
    if followers:
        low, high = groom.bounds
        groom = groom.with_followers(followers, float(max(high - low)) / 200 if spread is None else spread)
    if radius is not None:
        groom = groom.with_thickness(radius, tip)
    return groom


def _variation(given: list[str]) -> dict[str, Any]:
    """The arguments of `vary` from NAME=NUMBER, or three numbers for a dye."""
    out: dict[str, Any] = {}
    for text in given:
        name, _, value = text.partition("=")
        try:
            numbers = [float(x) for x in value.split(",")]
        except ValueError:
            raise ValueError(f"--vary takes NAME=NUMBER, such as melanin=1.3, or dye=R,G,B; got {text!r}") from None
        if name not in VARIATIONS:
            raise ValueError(f"--vary has no {name!r}; it has {', '.join(VARIATIONS)}")
        if name in out:
            raise ValueError(f"--vary was given {name} twice; leave one out")
        first = int(numbers[0]) if name == "seed" and numbers[0].is_integer() else numbers[0]
        out[name] = numbers if name == "dye" or len(numbers) > 1 else first  # several, or part of a seed, vary refuses
    return out


def _check_fibre(name: str) -> None:
    if name.endswith(".json"):
        Sampler.load(name)
    else:
        read_parameters_or_model(name)


@app.command("picture")
def picture_command(
    ctx: typer.Context,
    groom: GroomArgument,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="The picture to write, .exr or .png.")],
    fibre: FibreOption = "brown",
    light: LightOption = "studio",
    strength: Annotated[float, typer.Option(help="Factor on the light.")] = 1.0,
    technique: Annotated[str, typer.Option("--integrator", help=" | ".join(INTEGRATORS))] = "dual",
    depth: Annotated[int, typer.Option(help="Path segments, for --integrator path.")] = 64,
    counter: Annotated[str, typer.Option(help="How --integrator dual counts strands: grid | trace.")] = "grid",
    sampling: Annotated[
        str | None,
        typer.Option(
            help=f"{' | '.join(SAMPLINGS)}. Default: function where it has a closed form, else lobes. Files: their lobes."
        ),
    ] = None,
    spp: Annotated[int, typer.Option(help="Samples per pixel.")] = 64,
    radius: RadiusOption = None,
    tip: TipOption = None,
    followers: FollowersOption = 0,
    spread: SpreadOption = None,
    interpolate: Annotated[
        int, typer.Option(help="Number of strands to interpolate between those of the groom, which are then guides.")
    ] = 0,
    varied: Annotated[
        list[str] | None,
        typer.Option("--vary", metavar="NAME=NUMBER", help="Vary the strands (melanin, strays, dye, ...). Repeatable."),
    ] = None,
    bust: Annotated[bool, typer.Option("--bust", help="Put head, neck and shoulders under the hair.")] = False,
    frame: FrameOption = None,
    ignore: IgnoreOption = None,
    width: WidthOption = 512,
    height: Annotated[int | None, typer.Option(help="Height in pixels. Default: the width.")] = None,
    azimuth: AzimuthOption = 25.0,
    elevation: ElevationOption = 10.0,
    zoom: ZoomOption = 1.0,
    exposure: Annotated[float, typer.Option(help="Exposure of a PNG, in stops.")] = 0.0,
    seed: Annotated[int, typer.Option(help="Seed of the random numbers.")] = 0,
    variant: VariantOption = "scalar_rgb",
    json_output: JsonOption = False,
) -> None:
    """Render a groom to an EXR or a PNG file."""
    from cuticle.render.picture import MAX_EXPOSURE, MAX_SEED, MAX_SPP, expected_seconds, picture_path, render, save_picture

    target = picture_path(output)
    check_file(target)
    validate.integer("--spp", spp, 1, MAX_SPP)
    validate.integer("--seed", seed, 0, MAX_SEED)
    validate.number("--exposure", exposure, -MAX_EXPOSURE, MAX_EXPOSURE, unit="stops")
    if target.suffix.lower() != ".png":
        refuse_idle(ctx, "for an .exr, which is linear", "exposure")
    if technique != "path":
        refuse_idle(ctx, "without --integrator path", "depth")
    if technique != "dual":
        refuse_idle(ctx, "without --integrator dual", "counter")
    if fibre.endswith(".json") and sampling in (None, "lobes"):
        refuse_idle(ctx, "for a sampler's file, whose lobes are drawn from", "sampling")
    _check_groom(ctx, radius, tip, followers, spread)
    if validate.integer("--interpolate", interpolate, 0, MAX_STRANDS) and followers:
        raise ValueError("--interpolate makes strands between those of the groom, --followers beside them; leave out one")
    view = View(azimuth=azimuth, elevation=elevation, width=width, height=width if height is None else height, zoom=zoom)
    lit = Light(light, strength)
    validate.choice("--counter", counter, ("grid", "trace"))
    own: dict[str, Any] = {"counter": counter} if technique == "dual" else {}
    how = integrator(technique, depth=depth, **own)
    _check_fibre(fibre)
    variation = _variation(varied or [])
    hair = _groom(groom, radius, tip, followers, spread, frame, ignore or [])
    under = (head_bust() if groom == ["head"] else Bust.fitted(hair)) if bust else None
    if interpolate:
        hair = hair.interpolated(interpolate)
    if varied:
        hair = vary(hair, **variation)
    material = bsdf(fibre, sampling, strands=technique == "dual")
    if chiang := varies(hair) & {"color", *FORMS["chiang"]} - {"eta"}:  # the groom tells a fibre of its own
        if not was_given(ctx, "fibre"):
            del material["fibre"]
        elif not isinstance(read_parameters_or_model(fibre), Chiang):
            raise ValueError(
                f"the groom's {min(chiang)} is for Chiang's fibres: leave --fibre out, give a .toml with [chiang], or"
                f" --ignore {min(chiang)}"
            )
    mi = mitsuba(variant)
    with progress_bar(json_output) as progress:
        progress("fitting the fibre, loading the scene", 0.0)
        others = {} if under is None else {"bust": bust_shape(mi, under)}
        scene = load_scene(mi, hair, material, view=view, light=lit, technique=how, others=others)
        seconds = expected_seconds(scene, spp)
        if seconds is not None:
            progress.expect(seconds)
        done = render(scene, spp, seed=seed, progress=progress)
    save_picture(target, done.image, exposure=exposure)
    if json_output:
        facts = {"output": str(target), "strands": hair.strands, "spp": done.spp, "seconds": round(done.seconds, 3)}
        print(json.dumps(facts))
    else:
        out.print(
            f"wrote {target}: {hair.strands:,} strands, {done.spp} samples per pixel in {done.seconds:.1f} s", soft_wrap=True
        )


@app.command("compare")
def compare_command(
    ctx: typer.Context,
    groom: GroomArgument,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for compare.json, sheet.png, curves.png.")
    ],
    fibre: FibreOption = "brown",
    light: LightOption = "env",
    seconds: Annotated[float, typer.Option(help="Rendering time of each picture.")] = 10.0,
    reference_spp: Annotated[int, typer.Option(help="Samples per pixel of the reference.")] = 2048,
    radius: RadiusOption = None,
    tip: TipOption = None,
    followers: FollowersOption = 0,
    spread: SpreadOption = None,
    frame: FrameOption = None,
    ignore: IgnoreOption = None,
    width: WidthOption = 192,
    azimuth: AzimuthOption = 25.0,
    elevation: ElevationOption = 10.0,
    zoom: ZoomOption = 1.0,
    variant: VariantOption = "scalar_rgb",
    json_output: JsonOption = False,
) -> None:
    """Compare the samplings that a fibre offers on one scene: errors at equal samples and at equal time."""
    validate.number("--seconds", seconds, 0.1, 3600)
    validate.integer("--reference-spp", reference_spp, 16, 1 << 20)
    _check_groom(ctx, radius, tip, followers, spread)
    view = View(azimuth=azimuth, elevation=elevation, width=width, height=width, zoom=zoom)
    lit = Light(light)
    _check_fibre(fibre)
    hair = _groom(groom, radius, tip, followers, spread, frame, ignore or [])
    mitsuba(variant)
    check_directory(output)
    from cuticle.render.compare import compare_samplings

    with progress_bar(json_output) as progress:
        result = compare_samplings(
            hair,
            fibre,
            view=view,
            light=lit,
            seconds=seconds,
            reference_spp=reference_spp,
            variant=variant,
            progress=progress,
        )
    with filling(output) as folder:
        result.save(folder)
    plain = result.to_dict()
    if json_output:
        print(json.dumps(plain, indent=2))
        return
    grid = table(
        f"{fibre}, {light} light, {hair.strands:,} strands, {width} x {width}, path depth 2",
        f"reference: {reference_spp} samples per pixel, relMSE of its own noise {result.reference_error:.2g}",
    )
    for column in ("technique", "sampling", "relMSE, equal samples", "relMSE, equal time", "samples in that time", "gain"):
        grid.add_column(column, justify="left" if column in ("technique", "sampling") else "right")
    for c in plain["contenders"]:
        same, timed = c["equal_samples"], c["equal_time"]
        grid.add_row(
            {"bsdf": "BSDF sampling alone", "mis": "with emitter sampling"}[c["technique"]],
            c["sampling"],
            f"{same['rel_mse']:.3g} ({same['spp']})",
            f"{timed['rel_mse']:.3g}",
            f"{timed['spp']}",
            f"{c['gain_over_uniform']:.2f}",
        )
    out.print(grid)
    out.print("gain: how many times longer uniform sampling takes to reach the same error")
    out.print(f"wrote {output / 'compare.json'}, {output / 'sheet.png'}, {output / 'curves.png'}", soft_wrap=True)
