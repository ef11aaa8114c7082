"""USD and Alembic: every basis, wrap and interpolation of widths is read as what its format says it is."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from command import refused
from cuticle.grooms import splines, usd
from cuticle.grooms.groom import read_groom

Usd = pytest.importorskip("pxr.Usd", reason="usd-core is not installed")
from pxr import Gf, UsdGeom  # noqa: E402 - comes with it

HEAD = "#usda 1.0\n"
LINE = 'int[] curveVertexCounts=[2]\n point3f[] points=[(0,0,0),(0,1,0)]\n uniform token type="linear"\n'


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    """USD is read in this process: starting one for each file takes a second."""
    monkeypatch.setattr(usd, "read_apart", lambda module, path, *rest: usd._find(str(path), *rest))


VARYING = [0.05, 0.1, 0.25, 0.4, 0.25, 0.1, 0.05]
# Points and radii that follow from the schema's definition of the curves in each file.
FIELD = {
    # the Bezier curve at t = 0, 1/4 ... 1, widths linear in t
    "bezier": (
        [[0, 0, 0], [0.15625, 2.25, 0], [0.5, 3, 0], [0.84375, 2.25, 0], [1, 0, 0]],
        [0.05, 0.0625, 0.075, 0.0875, 0.1],
    ),
    "bspline_nonperiodic": ([[0, 1, 0], [0, 2, 0]], [0.1, 0.2]),  # the outer points are not reached
    "bspline_varying": (
        [[0, 0, 0], [5 / 6, 1, 0], [5 / 6, 2, 0], [0, 3, 0], [-5 / 6, 4, 0], [-5 / 6, 5, 0], [0, 6, 0]],
        VARYING,
    ),
    "periodic": ([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 0]], [0.1] * 5),
    "primvars_widths": ([[0, 0, 0], [0, 1, 0], [0, 2, 0]], [0.1, 0.05, 0.025]),
    "inst": ([[1, 0, 0], [1, 1, 0], [6, 0, 0], [6, 1, 0]], [0.1] * 4),
    "timesampled": ([[0, 0, 0], [0, 1, 0], [0, 2, 0]], [0.1] * 3),
    "timesampled_counts": ([[0, 0, 0], [0, 1, 0], [0, 2, 0]], [0.1, 0.05, 0.025]),
    "timesampled_widths": ([[0, 0, 0], [0, 1, 0], [0, 2, 0]], [0.1, 0.05, 0.025]),
    "zero_count_end": ([[0, 0, 0], [0, 1, 0], [0, 2, 0]], [0.1, 0.05, 0.025]),
    "mix": (
        [[0, 0, 0], [0, 1, 0], [0, 2, 0], *([1, 0.75 * k, 0] for k in range(9))],
        [0.25] * 3 + [0.05, 0.1375, 0.225, 0.3125, 0.4, 0.3125, 0.225, 0.1375, 0.05],
    ),
}


@pytest.mark.parametrize("name", FIELD)
def test_usd_of_the_field(name: str, data: Path, here: None) -> None:
    points, radius = FIELD[name]
    found = read_groom(data / "field" / f"{name}.usda")
    np.testing.assert_allclose(found.points, points, atol=1e-6)
    np.testing.assert_allclose(found.radius, radius, rtol=1e-6)


def test_a_bezier_segment_is_rendered_as_it_is(data: Path, here: None) -> None:
    found = read_groom(data / "field" / "bezier.usda")
    control, _ = found.control_points()

    # A cubic's blossom: the control points of the uniform B-spline over four quarters of [0, 1].
    def blossom(*t: float) -> np.ndarray:
        b = np.array([[0, 0, 0], [0, 4, 0], [1, 4, 0], [1, 0, 0]], float)
        for u in t:
            b = (1 - u) * b[:-1] + u * b[1:]
        return b[0]

    expected = [blossom(*((k + j) / 4 for j in (-1, 0, 1))) for k in range(-1, 6)]
    np.testing.assert_allclose(control[:, :3], expected, atol=1e-5)


def test_frames_and_what_is_left_out(data: Path, tmp_path: Path) -> None:
    field = data / "field"
    assert read_groom(field / "timesampled.usda", frame=1.5).points[-1].tolist() == [0.5, 2, 0]
    with pytest.warns(UserWarning, match=r"invisible_guides\.usda: left out 1 invisible prim\(s\): /g/hidden$"):
        assert read_groom(field / "invisible_guides.usda").points.tolist() == [[1, 0, 0], [1, 1, 0]]
    with pytest.raises(ValueError, match=r"bad\.usda: .*bad\.usda:2:15: Expected } at 'garbage garbage }'"):
        read_groom(field / "bad.usda")
    for path, frame, words in (
        (field / "timesampled.usda", "7", "frame must be in [1, 2], got 7"),
        (field / "bezier.usda", "7", "has no time samples, frame must be left out, got 7"),
        (field / "bom.txt", "7", "frame is for .usd, .usda"),
        ("ball", "7", "--frame is the time to read USD or Alembic at; a built-in groom has none"),
    ):
        refused("render", str(path), "-o", "a.png", "--frame", frame, words=words, cwd=tmp_path)


def stage(path: Path, **settings: Any) -> Any:
    made = Usd.Stage.CreateNew(str(path))
    for name, value in settings.items():
        made.SetMetadata(name, value)
    return made


def curves(
    at: Any, name: str, points: Any, counts: list[int], *, type_: str = "linear", widths: Any = None, **more: Any
) -> Any:
    made = UsdGeom.BasisCurves.Define(at, name)
    made.CreatePointsAttr([tuple(map(float, p)) for p in points])
    made.CreateCurveVertexCountsAttr(counts)
    made.CreateTypeAttr(type_)
    for token, value in more.items():
        getattr(made, f"Create{token.capitalize()}Attr")(value)
    if widths is not None:
        made.CreateWidthsAttr(widths[1])
        made.SetWidthsInterpolation(widths[0])
    return made


def test_units_up_axis_places_and_missing_widths(tmp_path: Path, here: None) -> None:
    made = stage(tmp_path / "a.usda", metersPerUnit=0.01, upAxis="Z")
    head = UsdGeom.Xform.Define(made, "/head")
    head.AddTranslateOp().Set(Gf.Vec3d(100, 200, 300))
    head.AddScaleOp().Set(Gf.Vec3f(2, 2, 2))
    curves(made, "/head/a", [[0, 0, 0], [10, 20, 30]], [2], widths=("constant", [0.5]))
    curves(made, "/head/b", [[0, 0, 0], [0, 0, 10]], [2])
    made.Save()
    with pytest.warns(UserWarning, match="/head/b without widths: 1/4000 of the groom's size"):
        found = read_groom(tmp_path / "a.usda")
    np.testing.assert_allclose(found.points, [[1, 3, -2], [1.2, 3.6, -2.4], [1, 3, -2], [1, 3.2, -2]], atol=1e-6)
    size = np.linalg.norm([0.2, 0.6, 0.4])
    np.testing.assert_allclose(found.radius, [0.005, 0.005, size / 4000, size / 4000], rtol=1e-5)


def test_point_instancers_draw_their_prototypes_where_they_say(tmp_path: Path, here: None) -> None:
    made = stage(tmp_path / "a.usda")
    instancer = UsdGeom.PointInstancer.Define(made, "/i")
    instancer.AddTranslateOp().Set(Gf.Vec3d(0, 0, 5))
    UsdGeom.Xform.Define(made, "/i/tuft").AddScaleOp().Set(Gf.Vec3f(2, 2, 2))
    curves(made, "/i/tuft/hair", [[0, 0, 0], [0, 1, 0]], [2], widths=("constant", [0.5]))
    instancer.CreatePrototypesRel().AddTarget("/i/tuft")
    instancer.CreateProtoIndicesAttr([0, 0, 0])
    instancer.CreatePositionsAttr([(1, 0, 0), (3, 0, 0), (9, 9, 9)])
    instancer.InvisId(2, Usd.TimeCode.Default())
    made.Save()
    found = read_groom(tmp_path / "a.usda")
    np.testing.assert_allclose(found.points, [[1, 0, 5], [1, 2, 5], [3, 0, 5], [3, 2, 5]], atol=1e-6)
    np.testing.assert_allclose(found.radius, 0.5)


KINDS = [("linear", "bezier"), *(("cubic", basis) for basis in splines.BASES)]


@pytest.mark.parametrize("wrap", splines.WRAPS)
@pytest.mark.parametrize(("type_", "basis"), KINDS)
def test_numbers_of_values_are_those_of_the_schema(type_: str, basis: str, wrap: str, tmp_path: Path, here: None) -> None:
    counts = [6, 3, 9] if (basis, wrap, type_) == ("bezier", "periodic", "cubic") else [7, 4, 10]
    points = np.random.default_rng(1).normal(size=(sum(counts), 3))
    made = stage(tmp_path / "a.usda")
    prim = curves(made, "/a", points, counts, type_=type_, basis=basis, wrap=wrap)
    own = list(prim.ComputeSegmentCounts(Usd.TimeCode.Default()))  # USD's
    assert [splines.segments(c, type_, basis, wrap) for c in counts] == own
    size = sum(own) + (0 if wrap == "periodic" else len(own))  # the schema's table; ComputeVaryingDataSize differs if pinned
    for interpolation, number in (("constant", 1), ("uniform", 3), ("varying", size), ("vertex", sum(counts))):
        prim.CreateWidthsAttr([0.5] * number)
        prim.SetWidthsInterpolation(interpolation)
        made.Save()
        np.testing.assert_allclose(read_groom(tmp_path / "a.usda").radius, 0.25, rtol=1e-6)
        prim.CreateWidthsAttr([0.5] * (number + 1))
        made.Save()
        with pytest.raises(ValueError, match=f"/a: it has {number + 1} widths, must have {number} if {interpolation}"):
            read_groom(tmp_path / "a.usda")


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (
            'def BasisCurves "a" { int[] curveVertexCounts=[3]\n point3f[] points=[(0,0,0)]\n}',
            "/a has 1 points, its curves say 3",
        ),
        (
            'def BasisCurves "a" { int[] curveVertexCounts=[3]\n point3f[] points=[(0,0,0),(0,1,0),(1,1,0)]\n'
            ' uniform token type="cubic"\n uniform token basis="bspline"\n}',
            "/a: a nonperiodic bspline curve must have at least 4 vertices, got 3",
        ),
        (
            'def BasisCurves "a" { uniform token basis="hermite"\n' + LINE.replace("linear", "cubic") + "}",
            "basis must be one of",
        ),
        ('def Xform "a" {}', "holds no BasisCurves"),
        (
            f'def NurbsCurves "n" {{ }}\ndef BasisCurves "a" {{ token visibility="invisible"\n{LINE} }}',
            "holds no BasisCurves; left out",
        ),
    ],
)
def test_a_wrong_usd_is_refused(body: str, words: str, tmp_path: Path, here: None) -> None:
    (tmp_path / "a.usda").write_text(HEAD + body)
    with pytest.raises(ValueError, match=words):
        read_groom(tmp_path / "a.usda")


# Alembic


def test_what_a_stage_refers_to_and_is_missing_is_told(tmp_path: Path, here: None) -> None:
    text = f'{HEAD}def "far" (references = @missing.usda@) {{}}\ndef BasisCurves "near" {{ {LINE} }}\n'
    (tmp_path / "a.usda").write_text(text)
    with pytest.warns(UserWarning, match="left out 1 what USD cannot find: .*missing.usda"):
        assert read_groom(tmp_path / "a.usda").strands == 1


@pytest.fixture
def archive(tmp_path: Path) -> Callable[..., Path]:
    """An archive with one object of curves below a transform, written by Alembic's own library."""
    pytest.importorskip("alembic3d", reason="alembic3d is not installed")
    import imath
    from alembic3d import Abc, AbcGeom

    def write(
        vertices: Any,
        counts: list[int],
        widths: Any,
        scope: str,
        how: tuple[str, str, str],
        visible: bool = True,
        samples: int = 1,
    ) -> Path:
        path = tmp_path / "a.abc"
        top = Abc.OArchive(str(path)).getTop()
        place, numbers, values = (
            AbcGeom.OXform(top, "head"),
            imath.IntArray(len(counts)),
            imath.FloatArray(len(widths)),
        )
        made = AbcGeom.OCurves(place, "hair")
        for array, given in ((numbers, counts), (values, widths)):
            for k, value in enumerate(given):
                array[k] = value
        width = AbcGeom.OFloatGeomParamSample(values, getattr(AbcGeom.GeometryScope, scope))
        type_, wrap, basis = (
            getattr(t, n) for t, n in zip((AbcGeom.CurveType, AbcGeom.CurvePeriodicity, AbcGeom.BasisType), how, strict=True)
        )
        for step in range(samples):
            sample = AbcGeom.XformSample()
            sample.setTranslation(imath.V3d(1 + 10 * step, 2, 3))
            sample.setScale(imath.V3d(2, 2, 2))
            place.getSchema().set(sample)
            positions = imath.V3fArray(len(vertices))
            for k, v in enumerate(vertices):
                positions[k] = imath.V3f(*map(float, v)) + imath.V3f(5 * step, 0, 0)
            made.getSchema().set(
                AbcGeom.OCurvesSchemaSample(
                    positions,
                    numbers,
                    type_,
                    wrap,
                    width,
                    AbcGeom.OV2fGeomParamSample(),
                    AbcGeom.ON3fGeomParamSample(),
                    basis,
                )
            )
        if not visible:
            AbcGeom.CreateVisibilityProperty(made, 0).setValue(0)
        return path

    return write


def test_alembic_is_read_in_world_space(archive: Callable[..., Path]) -> None:
    path = archive(
        [[0, 0, 0], [0, 1, 0], [0, 2, 0], [0, 3, 0]],
        [4],
        [0.2, 0.4],
        "kVaryingScope",
        ("kCubic", "kNonPeriodic", "kBsplineBasis"),
    )
    found = read_groom(path)
    np.testing.assert_allclose(found.points, [[1, 4, 3], [1, 6, 3]], atol=1e-6)
    np.testing.assert_allclose(found.radius, [0.2, 0.4], rtol=1e-6)
    data = path.read_bytes()
    for size in (len(data) // 2, len(data) - 40):  # cut, it is refused
        path.write_bytes(data[:size])
        with pytest.raises(ValueError, match=r"a\.abc"):
            read_groom(path)
    path.write_bytes(data[:16] + b"\xa5" * (len(data) - 16))
    with pytest.raises(ValueError, match=r"cannot read groom .*a\.abc: ."):
        read_groom(path)


def test_a_frame_of_an_archive_is_the_sample_nearest_to_that_second(archive: Callable[..., Path]) -> None:
    """Curves move by 5 a sample and their place by 10: a sample each second, as is where an archive says nothing."""
    path = archive([[0, 0, 0], [0, 1, 0]], [2], [0.2], "kConstantScope", ("kLinear", "kNonPeriodic", "kNoBasis"), samples=2)
    for frame, x in ((None, 1), (0.0, 1), (0.4, 1), (0.6, 21), (1.0, 21)):  # the place doubles
        assert read_groom(path, frame=frame).points[:, 0].tolist() == [x, x]
    with pytest.raises(ValueError, match=r"frame must be in \[0, 1\], got 2$"):
        read_groom(path, frame=2.0)
    still = archive([[0, 0, 0], [0, 1, 0]], [2], [0.2], "kConstantScope", ("kLinear", "kNonPeriodic", "kNoBasis"))
    with pytest.raises(ValueError, match=r"no time samples, frame must be left out, got 1$"):
        read_groom(still, frame=1.0)


def test_hidden_alembic_curves_are_left_out(archive: Callable[..., Path]) -> None:
    path = archive(
        [[0, 0, 0], [0, 1, 0]], [2], [0.2], "kConstantScope", ("kLinear", "kNonPeriodic", "kNoBasis"), visible=False
    )
    with pytest.raises(ValueError, match=r"holds no curves; left out 1 invisible object\(s\): /head/hair"):
        read_groom(path)


def test_a_real_archive(data: Path) -> None:
    pytest.importorskip("alembic3d", reason="alembic3d is not installed")
    a, b = (read_groom(data / "hair" / "readers" / f"Bangs_100.{e}") for e in ("abc", "data"))
    np.testing.assert_array_equal(a.offsets, b.offsets)
    np.testing.assert_allclose(a.points, b.points, atol=1e-4)  # the writers' rounding, of 236 units
