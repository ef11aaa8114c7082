"""Attributes in files: what each format holds for strands and for points is read as it says, the rest is named."""

from __future__ import annotations

import struct
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cuticle.grooms import usd
from cuticle.grooms.groom import Groom, read_groom
from cuticle.grooms.procedural import wavy_lock

POINTS = np.array([[k % 3, k, -k / 2] for k in range(7)], np.float32)  # strands of 4 and of 3


def values(groom: Groom) -> dict[str, Any]:
    return {name: np.round(v, 6).tolist() for name, v in groom.attributes.items()}


def test_npz_gives_back_the_groom_bit_for_bit(groom: Groom, tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    given = {"file": rng.normal(size=4), "hair:melanin": rng.normal(size=(14, 3)), "a/b.npy": [1, 2, 3, 4]}
    whole = replace(groom, attributes=given, bend=rng.normal(size=(4, 2, 4)))
    whole.save(tmp_path / "a.NPZ")
    assert read_groom(tmp_path / "a.NPZ") == whole
    first = (tmp_path / "a.NPZ").read_bytes()
    whole.save(tmp_path / "a.NPZ")
    assert (tmp_path / "a.NPZ").read_bytes() == first
    whole.save(tmp_path / "a.txt")
    assert dict(read_groom(tmp_path / "a.txt").attributes) == {}


def test_npz_refuses_names_that_are_one_to_numpy(groom: Groom, tmp_path: Path) -> None:
    each = np.zeros((groom.strands, 1))
    with pytest.raises(ValueError, match=r"NumPy takes 'a\.npy' and 'a' for one name"):
        groom.with_attributes(**{"a.npy": each, "a": each}).save(tmp_path / "a.npz")
    assert not (tmp_path / "a.npz").exists()


def test_three_values_a_strand_of_three_points_are_said_to_be_points(tmp_path: Path) -> None:
    points = np.arange(18.0).reshape(2, 3, 3)
    np.savez(tmp_path / "a.npz", points=points, radius=np.array(0.1), color=np.ones((2, 3)))
    with pytest.warns(UserWarning, match=r"took color of shape \(2, 3\) as a value at each of a strand's 3 points"):
        assert read_groom(tmp_path / "a.npz").attributes["color"].shape == (6,)


def test_a_groom_is_not_written_as_what_its_ending_is_not(groom: Groom, tmp_path: Path) -> None:
    for name in ("a.hair", "a.USD", "a.ply"):
        with pytest.raises(ValueError, match=r"as \.npz or as Mitsuba's text, not as .*; end the name in \.npz or \.txt"):
            groom.save(tmp_path / name)
        assert not (tmp_path / name).exists()
    groom.save(tmp_path / "a.strands")  # Mitsuba takes any


def test_npz_of_others_holds_attributes_beside_points(tmp_path: Path) -> None:
    points = np.arange(24.0).reshape(2, 4, 3)
    np.savez(
        tmp_path / "a.npz", points=points, radius=np.array(0.1), each=np.array([5, 6], np.uint8), along=points[..., 0],
        colour=points, tag=np.array(["a", "b"]), far=np.array([1e300, 0]), m=np.zeros((2, 5, 4)),
    )  # fmt: skip
    with pytest.warns(UserWarning, match=r"a\.npz: left out attribute tag \(.*\)$") as told:
        found = read_groom(tmp_path / "a.npz")
    (warning,) = told
    assert str(warning.message).split(": ", 1)[1] == (
        "left out attribute tag (must be an array of numbers, got an array of <U1), far (must be finite numbers in single"
        " precision, strand 0 has inf), m (must have shape (2,) or (2, C), one value a strand, or (8,) or (8, C), one a"
        " point, C from 1 to 32; got (2, 5, 4))"
    )
    assert values(found) == {"each": [5, 6], "along": [0, 3, 6, 9, 12, 15, 18, 21], "colour": points.reshape(-1, 3).tolist()}


def test_values_of_left_out_strands_and_points_are_left_out(tmp_path: Path) -> None:
    points = np.array([[0, 0, 0], [0, 0, 0], [0, 1, 0], [5, 5, 5], [5, 5, 5], [1, 0, 0], [1, 2, 0], [2, 0, 0], [2, 1, 0]])
    radius = np.array([0.1] * 5 + [0] * 2 + [0.1] * 2)
    more = {"each": np.arange(4), "along": np.arange(9)}
    np.savez(tmp_path / "a.npz", points=points, counts=np.array([3, 2, 2, 2]), radius=radius, **more)
    with pytest.warns(
        UserWarning, match=r"left out 1 repeated point and 1 strand of no length and 1 strand\(s\) of no width"
    ):
        assert values(read_groom(tmp_path / "a.npz")) == {"each": [0, 3], "along": [0, 2, 7, 8]}


@pytest.mark.parametrize("thickness", [False, True])
def test_cyhair_holds_transparency_and_colours(tmp_path: Path, thickness: bool) -> None:
    flags = 1 | 2 | 8 | 16 | 4 * thickness
    data = struct.pack("<4sIIIIf", b"HAIR", 2, 7, flags, 0, 0.25).ljust(128, b"\0") + struct.pack("<HH", 3, 2)
    data += POINTS.tobytes() + np.full(7 * thickness, 0.25, "<f4").tobytes()
    clear, colours = np.linspace(0, 1, 7, dtype="<f4"), np.arange(21, dtype="<f4").reshape(7, 3)
    data += clear.tobytes() + colours.tobytes()
    (tmp_path / "a.hair").write_bytes(data)
    found = read_groom(tmp_path / "a.hair")
    np.testing.assert_array_equal(found.attributes["transparency"], clear)
    np.testing.assert_array_equal(found.attributes["color"], colours)
    assert found.radius.tolist() == [0.125] * 7
    (tmp_path / "a.hair").write_bytes(data[:-1])
    with pytest.raises(ValueError, match="cut short: the colors needs bytes"):
        read_groom(tmp_path / "a.hair")


PLY_HEAD = "ply\nformat ascii 1.0\nelement vertex 4\n" + "".join(
    f"property {kind}\n"
    for kind in ("float x", "float y", "float z", "float nx", "uchar red", "double m", "list uchar int two", "float id")
)
PLY_ROWS = "\n".join(f"{k} {k * k} 0 1 {10 * k} {k / 4} 2 0 0 {k}" for k in range(4))


@pytest.mark.parametrize(
    ("strands", "found", "lost"),
    [
        (
            "element strand 2\nproperty float dye\nproperty float id\nproperty list uchar int vertex_indices\n",
            {"red": [30, 10, 0, 20], "m": [0.75, 0.25, 0, 0.5], "dye": [5, 6]},
            r"two \(a list for each\), id \(both vertex and strand have one\)",
        ),
        (
            "element edge 2\nproperty int vertex1\nproperty int vertex2\nproperty float crease\n",
            {"red": [20, 0, 30, 10], "m": [0.5, 0, 0.75, 0.25], "id": [2, 0, 3, 1]},  # in the order of roots
            r"two \(a list for each\), crease \(edges have it, not strands\)",
        ),
    ],
)
def test_ply_holds_properties_of_vertices_and_of_strands(
    strands: str, found: dict[str, Any], lost: str, tmp_path: Path
) -> None:
    rows = "5 1 2 3 1\n6 2 2 0 2\n" if "strand" in strands else "3 1 7\n2 0 8\n"
    (tmp_path / "a.ply").write_text(f"{PLY_HEAD}{strands}end_header\n{PLY_ROWS}\n{rows}")
    with pytest.warns(UserWarning, match=f"left out attribute {lost}$"):
        assert values(read_groom(tmp_path / "a.ply")) == found


USD = """#usda 1.0
def Xform "head"
{
    double3 xformOp:translate = (1, 2, 3)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    float primvars:melanin.timeSamples = { 1: 1.0, 3: 3.0 }
    def BasisCurves "hair"
    {
        uniform token type = "TYPE"
        uniform token basis = "bspline"
        int[] curveVertexCounts = [5, 0, 4]
        point3f[] points = [(0,0,0), (0,1,0), (1,2,0), (1,3,0), (1,4,1), (5,0,0), (5,1,0), (5,2,1), (5,4,1)]
        float[] widths = [0.1] (interpolation = "constant")
        MORE
    }
}
"""
LINEAR = {
    'color3f[] primvars:dye = [(1, 0, 0), (0, 1, 0)] (interpolation = "uniform")\n int[] primvars:dye:indices = [1, 0, 0]':
        {"dye": [[0, 1, 0], [1, 0, 0]]},
    'half[] primvars:hair:m = [0, 1, 2, 3, 4, 5, 6, 7, 8] (interpolation = "vertex")': {"hair:m": list(range(9))},
    'double[] primvars:m = [0, 1, 2, 3, 4, 5, 6, 7, 8] (interpolation = "varying")': {"m": list(range(9))},
    'int[] primvars:m = [0, 1, 2, 3, 4, 5, 6, 7, 8] (interpolation = "faceVarying")': {"m": list(range(9))},
    'color3f primvars:m = (1, 2, 3)': {"m": [[1, 2, 3]] * 2},
    'float[] primvars:m = [1, 2, 3, 4, 5, 6] (elementSize = 2; interpolation = "uniform")': {"m": [[1, 2], [5, 6]]},
    'normal3f[] primvars:normals = [(0, 0, 1)] (interpolation = "constant")': {},
}  # fmt: skip
CUBIC = {  # at a knot a B-spline weighs its vertices 1, 4, 1; a value at a segment's end is there already
    'float[] primvars:m = [0, 6, 0, 12, 0, 6, 0, 6, 0] (interpolation = "vertex")': {"m": [4, 3, 8, 2, 4]},
    'float[] primvars:m = [0, 1, 2, 3, 4] (interpolation = "varying")': {"m": [0, 1, 2, 3, 4]},
    'float2[] primvars:m = [(1, 0), (2, 0), (3, 1)] (interpolation = "uniform")': {"m": [[1, 0], [3, 1]]},
}
LOST = {
    'string[] primvars:m = ["a", "b", "c"] (interpolation = "uniform")': "/head/hair: it is no whole list of numbers",
    "matrix4d primvars:m = ((1,0,0,0), (0,1,0,0), (0,0,1,0), (0,0,0,1))": "no whole list of numbers",
    'float[] primvars:m = [1, 2] (interpolation = "uniform")': "/head/hair: it has 2 values, must have 3 if uniform",
    'float[] primvars:m = [1]\n int[] primvars:m:indices = [7]': "no whole list of numbers",
    'float[] primvars:m = [1, nan, 2] (interpolation = "uniform")': "",
    'float primvars:radius = 2': "an attribute cannot be called 'radius'",
}  # fmt: skip


@pytest.fixture
def usd_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """USD is read in this process: starting one for each file takes a second."""
    pytest.importorskip("pxr.Usd", reason="usd-core is not installed")
    monkeypatch.setattr(usd, "read_apart", lambda module, path, *rest: usd._find(str(path), *rest))


@pytest.mark.parametrize(
    ("type_", "more", "found"), [*(("linear", *x) for x in LINEAR.items()), *(("cubic", *x) for x in CUBIC.items())]
)
def test_usd_primvars_are_attributes(type_: str, more: str, found: Any, tmp_path: Path, usd_here: None) -> None:
    (tmp_path / "a.usda").write_text(USD.replace("TYPE", type_).replace("MORE", more))
    groom = read_groom(tmp_path / "a.usda")
    assert values(groom) == found | {"melanin": [1, 1]}  # inherited
    assert values(read_groom(tmp_path / "a.usda", frame=2.0))["melanin"] == [2, 2]


@pytest.mark.parametrize(("more", "words"), LOST.items())
def test_a_primvar_that_no_groom_can_carry_is_named(more: str, words: str, tmp_path: Path, usd_here: None) -> None:
    (tmp_path / "a.usda").write_text(USD.replace("TYPE", "linear").replace("MORE", more))
    if "nan" in more:  # the second curve has no vertices, so its value is no strand's
        assert values(read_groom(tmp_path / "a.usda"))["m"] == [1, 2]
        return
    with pytest.warns(UserWarning, match=rf"a\.usda: left out attribute (m|radius) \(.*{words}"):
        assert values(read_groom(tmp_path / "a.usda")) == {"melanin": [1, 1]}


def test_objects_of_a_scene_keep_what_all_have(tmp_path: Path, usd_here: None) -> None:
    line = ' { int[] curveVertexCounts=[2]\n point3f[] points=[(0,0,0),(0,1,0)]\n uniform token type="linear"\n'
    text = "#usda 1.0\n" + "".join(
        f'def BasisCurves "{name}"{line}{more}\n float primvars:m = {k}\n}}\n'
        for k, (name, more) in enumerate({"a": "float primvars:only = 1", "b": ""}.items())
    )
    text += 'def BasisCurves "empty" { int[] curveVertexCounts=[]\n point3f[] points=[]\n}\n'  # lacks m, and no strand does
    (tmp_path / "a.usda").write_text(text)
    with pytest.warns(UserWarning, match=r"left out attribute only \(/b does not have it\)$"):
        assert values(read_groom(tmp_path / "a.usda")) == {"m": [0, 1]}


def test_alembic_parameters_are_attributes(tmp_path: Path) -> None:
    pytest.importorskip("alembic3d", reason="alembic3d is not installed")
    import imath
    from alembic3d import Abc, AbcGeom

    def filled(array: Any, given: Any) -> Any:
        for k, value in enumerate(given):
            array[k] = value
        return array

    scope = AbcGeom.GeometryScope
    archive = Abc.OArchive(str(tmp_path / "a.abc"))
    curves = AbcGeom.OCurves(archive.getTop(), "hair")
    schema = curves.getSchema()
    width = AbcGeom.OFloatGeomParamSample(filled(imath.FloatArray(1), [0.1]), scope.kConstantScope)
    schema.set(
        AbcGeom.OCurvesSchemaSample(
            filled(imath.V3fArray(7), [imath.V3f(*map(float, p)) for p in POINTS]), filled(imath.IntArray(2), [4, 3]),
            AbcGeom.CurveType.kLinear, AbcGeom.CurvePeriodicity.kNonPeriodic, width, AbcGeom.OV2fGeomParamSample(),
            AbcGeom.ON3fGeomParamSample(), AbcGeom.BasisType.kNoBasis,
        )
    )  # fmt: skip
    parameters = schema.getArbGeomParams()
    given = {
        "melanin": ("Float", imath.FloatArray(2), [1.0, 2.0], "kUniformScope"),
        "Cd": ("C3f", imath.C3fArray(7), [imath.Color3f(k, 0, 1) for k in range(7)], "kVertexScope"),
        "one": ("Int32", imath.IntArray(1), [3], "kConstantScope"),
        "half": ("Int16", imath.ShortArray(2), np.array([1, 1.5], np.float16).view(np.int16).tolist(), "kUniformScope"),
        "name": ("String", imath.StringArray(2), ["a", "b"], "kUniformScope"),
        "few": ("Double", imath.DoubleArray(3), [1.0, 2.0, 3.0], "kUniformScope"),
    }
    for name, (kind, array, content, where) in given.items():
        made = getattr(AbcGeom, f"O{kind}GeomParam")(parameters, name, False, getattr(scope, where), 1)
        made.set(getattr(AbcGeom, f"O{kind}GeomParamSample")(filled(array, content), getattr(scope, where)))
    indexed = AbcGeom.OFloatGeomParam(parameters, "indexed", True, scope.kUniformScope, 1)
    two, order = filled(imath.FloatArray(2), [8.0, 9.0]), filled(imath.UnsignedIntArray(2), [1, 0])
    indexed.set(AbcGeom.OFloatGeomParamSample(two, order, scope.kUniformScope))
    Abc.OFloatArrayProperty(parameters, "plain").setValue(filled(imath.FloatArray(7), map(float, range(7))))
    del made, indexed, parameters, schema, curves, archive
    data = bytearray((tmp_path / "a.abc").read_bytes())
    at = data.index(b"\4half") - 5  # the property's type, in the upper half of a byte: 4 is int16, 9 float16
    assert data[at] >> 4 == 4
    data[at] += 5 << 4  # PyAlembic reads halves, but cannot write them
    (tmp_path / "a.abc").write_bytes(data)
    words = r"left out attribute name \(/hair: it is no .*\), few \(/hair: it has 3 values, must have 2 if uniform\)$"
    with pytest.warns(UserWarning, match=words):
        found = read_groom(tmp_path / "a.abc")
    assert values(found) == {
        "melanin": [1, 2], "Cd": [[k, 0, 1] for k in range(7)], "one": [3, 3], "half": [1, 1.5],
        "indexed": [9, 8], "plain": list(range(7)),
    }  # fmt: skip


def test_a_groom_without_attributes_is_read_without_a_word(tmp_path: Path) -> None:
    lock = wavy_lock(5)
    lock.save(tmp_path / "a.npz")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert read_groom(tmp_path / "a.npz") == lock
