"""Tables as scattering functions: between their points, noise and holes, refusals, files."""

from __future__ import annotations

import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cuticle
from cuticle import Chiang, Tabulated
from cuticle.scattering.holes import fill_holes

BROWN = Chiang(beta_m=0.3, beta_n=0.3, eumelanin=1.3)
VIEWERS = np.linspace(-85, 85, 35)
THETA = np.linspace(-90, 90, 91)
TURN = np.arange(-180, 180, 3.0)
Values = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def values(model: Any = BROWN, theta_r: np.ndarray = VIEWERS, theta: np.ndarray = THETA, phi: np.ndarray = TURN) -> Values:
    r, t, p = (np.radians(x) for x in (theta_r, theta, phi))
    return r, t, p, model.eval(t[None, :, None], r[:, None, None], p)


@pytest.fixture(scope="module")
def clean() -> Values:
    return values()


@pytest.fixture(scope="module")
def own_fit() -> cuticle.Fit:
    return cuticle.fit(BROWN, 4)


def test_between_its_points_a_table_is_its_function(clean: Values) -> None:
    table = Tabulated(*clean)
    assert table.even
    rng = np.random.default_rng(1)
    ti, tr, phi = rng.uniform(-1.5, 1.5, 2000), rng.uniform(-1.45, 1.45, 2000), rng.uniform(-9, 9, 2000)
    f, g = table.eval(ti, tr, phi), BROWN.eval(ti, tr, phi)
    weight = np.cos(ti)[:, None]
    assert (np.abs(f - g) * weight).mean() / (g * weight).mean() < 0.02
    at = table.eval(clean[1][40], clean[0][3], clean[2][7])
    np.testing.assert_allclose(at, clean[3][3, 40, 7], rtol=1e-9)
    # A grid for one viewer goes another way to the same values.
    for made in (table, Tabulated(*values(BROWN.near(0.4)))):
        np.testing.assert_allclose(
            made.eval(ti[:20, None], 0.31, phi[:30]), made.eval(ti[:20, None], np.full((20, 30), 0.31), phi[:30]), rtol=1e-12
        )


def test_noise_and_holes_cost_a_sampler_next_to_nothing(clean: Values, own_fit: cuticle.Fit) -> None:
    rng = np.random.default_rng(2)
    f = clean[3] * (1 + 0.05 * rng.standard_normal(clean[3].shape))
    f[rng.random(f.shape[:3]) < 0.02] = np.nan
    table = Tabulated(*clean[:3], f)
    assert table.even  # found out: the sides differ by noise alone
    assert table.holes == pytest.approx(0.02, abs=0.002)
    assert "2 % holes filled" in repr(table)
    fitted = cuticle.fit(table, 4)
    for theta_r in np.radians([-85, -60, 0, 30, 75]):
        ess, best = (cuticle.measure(s, BROWN, theta_r).ess for s in (fitted.sampler, own_fit.sampler))
        assert ess > best - 0.01, np.degrees(theta_r)


@pytest.mark.parametrize(
    ("deviation", "loss", "energy"),  # of a viewer's largest f cos
    [
        pytest.param(0.01, 0.01, 0.05, marks=pytest.mark.slow),
        (0.05, 0.05, 0.2),
        pytest.param(0.15, 0.13, 0.4, marks=pytest.mark.slow),
    ],
)
def test_noise_about_zero_is_averaged_out(
    deviation: float, loss: float, energy: float, clean: Values, own_fit: cuticle.Fit
) -> None:
    top = (clean[3] * np.cos(clean[1])[:, None, None])[:, 1:-1].max(axis=(1, 2, 3), keepdims=True)
    f = clean[3] + deviation * top * np.random.default_rng(8).standard_normal(clean[3].shape)
    with pytest.warns(UserWarning, match=r"are smoothed as noise of .* energy by up to \d+(\.\d+)? %"):
        table = Tabulated(*clean[:3], f, smooth=True)
    with pytest.raises(ValueError, match=r"got [0-9,]+ below 0, .* smooth=True averages out"):
        Tabulated(*clean[:3], f)
    assert (table.values >= 0).all()
    np.testing.assert_allclose(table.energy, Tabulated(*clean).energy, rtol=energy)
    fitted = cuticle.fit(table, 4)
    for theta_r in np.radians([-60, 0, 30]):
        ess, best = (cuticle.measure(s, BROWN, theta_r).ess for s in (fitted.sampler, own_fit.sampler))
        assert ess > best - loss, np.degrees(theta_r)


def test_few_viewers_keep_their_highlight_between() -> None:
    table = Tabulated(*values(theta_r=np.linspace(-80, 80, 9)))
    fitted = cuticle.fit(table, 4)
    for theta_r in np.radians([-70, -10, 30]):  # 10 degrees from any that is known
        assert cuticle.measure(fitted.sampler, BROWN, theta_r).ess > 0.95


def test_one_viewer_and_one_side_are_warned_of() -> None:
    with pytest.warns(UserWarning, match=r"one viewer is known: at theta_r -90° .* given for 30°, moved by 120°"):
        one = Tabulated(*values(theta_r=np.array([30.0])))
    phi = np.linspace(0.2, 3, 5)
    moved = one.eval(np.radians(-50), np.radians(50), phi) / one.eval(np.radians(-30), np.radians(30), phi)
    np.testing.assert_allclose(moved, np.broadcast_to(moved[0], moved.shape), rtol=1e-9)  # scaled to its energy, else alike
    with pytest.warns(UserWarning, match=r"few viewers are known: at theta_r 0° .* moved by 40°"):
        Tabulated(*values(theta_r=np.array([-80.0, -40.0, 40.0, 80.0])))
    straight = Chiang(alpha=0.0, eumelanin=1.3)
    with pytest.warns(UserWarning, match="no viewer below 0° is known"):
        half = Tabulated(*values(straight, np.linspace(0, 80, 17)))
    f, g = half.eval(0.4, -0.5, 2.0), straight.eval(0.4, -0.5, 2.0)
    np.testing.assert_allclose(f, g, rtol=0.03)


@pytest.mark.parametrize(("step", "theta_r", "off"), [(5.0, 77.5, 0.001), (5.0, 82.5, 0.005), (10.0, 75.0, 0.015)])
def test_between_viewers_no_energy_appears(step: float, theta_r: float, off: float) -> None:
    """A shift alone has 1.05, 1.06 and 1.2 of the energy; what is left is the interpolation of energies."""
    table = Tabulated(*values(theta_r=np.arange(-85, 86, step), theta=np.linspace(-89, 89, 179)))
    exact, found = (cuticle.tabulate(m, np.radians(theta_r)).energy for m in (BROWN, table))
    np.testing.assert_allclose(found, exact, rtol=off)


def test_half_a_turn_is_an_even_function(clean: Values) -> None:
    half = Tabulated(*values(phi=np.linspace(0, 180, 61)))
    whole = Tabulated(*clean)
    assert half.even
    np.testing.assert_allclose(half.eval(0.2, 0.1, [-1.0, 1.0]), whole.eval(0.2, 0.1, [1.0, 1.0]), rtol=1e-6)
    np.testing.assert_allclose(half.energy, whole.energy, rtol=1e-3)


def test_a_function_that_is_not_even_is_left_so() -> None:
    near = BROWN.near(0.6)
    table = Tabulated(*values(near))
    assert not table.even
    rng = np.random.default_rng(3)
    noisy = Tabulated(*values(near)[:3], values(near)[3] * (1 + 0.05 * rng.standard_normal((35, 91, 120, 3))))
    assert not noisy.even
    f, g = table.eval(0.1, -0.2, [-2.0, 2.0]), near.eval(0.1, -0.2, [-2.0, 2.0])
    np.testing.assert_allclose(f, g, rtol=0.03)
    # Without the point that closes the turn, and with it, and begun elsewhere: one function.
    closed = Tabulated(*values(near, phi=np.linspace(-180, 180, 121)))
    turned = Tabulated(*values(near, phi=np.linspace(0, 357, 120)))
    for other in (closed, turned):
        np.testing.assert_allclose(other.eval(0.1, -0.2, [-3.1, 3.13]), table.eval(0.1, -0.2, [-3.1, 3.13]), rtol=1e-9)
    assert Tabulated(*values(near), even=True).even


def test_degrees_and_shapes(clean: Values) -> None:
    degrees = Tabulated(VIEWERS, THETA, TURN, clean[3], degrees=True)
    np.testing.assert_allclose(degrees.eval(0.3, 0.2, 1.0), Tabulated(*clean).eval(0.3, 0.2, 1.0), rtol=1e-9)
    grey = Tabulated(*clean[:3], clean[3].mean(axis=-1))
    assert grey.channels == 1
    single = Tabulated(*clean[:3], clean[3].astype(np.float32))
    np.testing.assert_allclose(single.eval(0.3, 0.2, 1.0), degrees.eval(0.3, 0.2, 1.0), rtol=1e-4)
    spectral = Tabulated(*clean[:3], np.repeat(clean[3], 4, axis=-1))
    assert cuticle.fit(spectral, 1).ess_channels.shape[-1] == 12


def _change(which: str) -> Callable[[Values], tuple[Any, ...]]:
    def change(v: Values) -> tuple[Any, ...]:
        r, t, p, f = (x.copy() for x in v)
        if which == "negative":
            f[3] -= 0.5 * f[3, 20:70].mean()
        if which == "noise":
            scale = (f * np.cos(t)[:, None, None]).max()
            f = f + 0.5 * scale * np.random.default_rng(1).standard_normal(f.shape)
        if which == "dark":
            f[3] = 0
        if which == "holes":
            f[3, :40] = np.nan
        if which == "infinite":
            f[3, 4, 5] = np.inf
        if which == "band":
            t, f = t[20:70], f[:, 20:70]
        if which == "wedge":
            p, f = p[:50], f[:, :, :50]
        if which == "coarse":
            p, f = p[::15], f[:, :, ::15]
        if which == "degrees":
            r, t, p = np.degrees(r), np.degrees(t), np.degrees(p)
        if which == "order":
            t = t[::-1]
        if which == "shape":
            f = f[:, :, :-1]
        if which == "units":
            f *= 1e4
        if which == "text":
            f = "hello"
        return r, t, p, f

    return change


@pytest.mark.parametrize(
    ("which", "message"),
    [
        ("negative", r"is negative, .* % still where noise averages out; .*; subtract a dark measurement"),
        ("noise", r"noise may have a deviation of 25 % .* measure longer"),
        ("dark", r"only zeros at theta_r -70°"),
        ("holes", r"at most 20 % .* got 44 % at theta_r -70°"),
        ("infinite", "3 infinite"),
        ("band", r"within 10° of both poles, got -50° to 48°"),
        ("wedge", r"whole turn, or from 0 to pi .* does not cover the sphere"),
        ("coarse", "30° apart at most, got 45°"),
        ("degrees", "angles are in radians: give degrees=True"),
        ("order", "theta_i must be increasing"),
        ("shape", r"values must have shape"),
        ("units", r"must be at most 1, got .* divide by the incoming light"),
        ("text", "must be an array of numbers"),
    ],
)
def test_a_table_that_is_none_is_refused_with_numbers(which: str, message: str, clean: Values) -> None:
    with pytest.raises((ValueError, TypeError), match=message) as caught:
        Tabulated(*_change(which)(clean), smooth=which in ("negative", "noise"))
    assert "\n" not in str(caught.value)


def test_what_is_doubtful_is_warned_of(clean: Values) -> None:
    with pytest.warns(UserWarning, match=r"is 2\.\d+ at theta_r .*is f 1/sr"):
        Tabulated(*clean[:3], clean[3] * 3)
    f = clean[3].copy()
    f[:, 45, 3] *= -0.01
    with pytest.warns(UserWarning, match=r"values below 0 \(.* % of the sum\) are set to 0"):
        table = Tabulated(*clean[:3], f)
    assert (table.values >= 0).all()


def test_a_band_of_holes_says_how_far_and_how_much(clean: Values) -> None:
    r, t, p, f = clean
    band = np.abs(t) <= np.radians(7)  # rows from -6° to 6°, between values at ±8°
    f = np.where(band[:, None, None] & (np.arange(len(r)) == len(r) // 2)[:, None, None, None], np.nan, f)
    with pytest.warns(UserWarning, match=r"up to 8° from the nearest value, at theta_r 0°; what was filled holds") as said:
        table = Tabulated(r, t, p, f)
    assert "% holes filled, up to 8° from a value" in repr(table)
    rows = table.values[len(r) // 2].sum(axis=(1, 2)) * np.cos(t)
    assert f"up to {100 * rows[band].sum() / rows.sum():.2g} % of a viewer's energy" in str(said[0].message)


def test_holes_are_filled_by_the_harmonic_function() -> None:
    rng = np.random.default_rng(4)
    t, p = np.meshgrid(np.linspace(0, 1, 40), np.linspace(0, 1, 30), indexing="ij")
    plane = (2 + t - 0.5 * p)[None, :, :, None] * np.array([1.0, 3.0])
    f = plane.copy()
    f[rng.random(f.shape) < 0.1] = np.nan
    f[0, 10:14, 12:16] = np.nan
    inner = np.isnan(f[0, 1:-1, 1:-1])
    fill_holes(f, False)
    np.testing.assert_allclose(f[0, 1:-1, 1:-1][inner], plane[0, 1:-1, 1:-1][inner], atol=0.03)
    assert np.isfinite(f).all()


# ---- files


def test_files_read_back(tmp_path: Path, clean: Values) -> None:
    for model in (BROWN, BROWN.near(0.5)):
        table = Tabulated(*values(model, VIEWERS[::4], THETA[::3], TURN[::2]))
        loaded = Tabulated.load(table.save(tmp_path / "table.npz"))
        np.testing.assert_allclose(loaded.values, table.values, rtol=1e-9, atol=1e-12)
        assert loaded.even == table.even
    np.savez(tmp_path / "deg.npz", theta_r_deg=VIEWERS, theta_i_deg=THETA, phi_deg=TURN, f=clean[3])
    np.testing.assert_allclose(Tabulated.load(tmp_path / "deg.npz").values, Tabulated(*clean).values, rtol=1e-9)


@pytest.mark.parametrize("names", ["f_b,f_g,f_r", "f_650,f_550,f_450", "blue,green,red", "B,G,R"])
def test_colours_of_a_csv_are_known_by_their_names(names: str, tmp_path: Path) -> None:
    r, t, p, f = values(theta_r=VIEWERS, theta=THETA[::10], phi=TURN[::10])
    angles = (a.ravel() for a in np.meshgrid(r, t, p, indexing="ij"))
    rows = np.column_stack([*angles, f.reshape(-1, 3)[:, ::-1]])
    np.savetxt(tmp_path / "t.csv", rows, delimiter=",", header="theta_r,theta_i,phi," + names, comments="")
    assert np.allclose(Tabulated.load(tmp_path / "t.csv").values, Tabulated(r, t, p, f).values, rtol=1e-6)


def test_a_table_is_written_as_what_is_read(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="a table is written as .npz, got .*t.csv; end the name in .npz"):
        Tabulated(*values()).save(tmp_path / "t.csv")


def test_a_csv_in_any_order_with_rows_missing(tmp_path: Path) -> None:
    r, t, p, f = values(theta_r=VIEWERS[::8], theta=THETA[::5], phi=TURN[::5])
    rows = [
        f"{np.degrees(r[i]):.6f},{np.degrees(t[j]):.6f},{np.degrees(p[k]):.6f}," + ",".join(f"{x:.9g}" for x in f[i, j, k])
        for i in range(len(r))
        for j in range(len(t))
        for k in range(len(p))
    ]
    rng = np.random.default_rng(5)
    rng.shuffle(rows)
    path = tmp_path / "table.csv"
    path.write_text("# made by hand\ntheta_r_deg,theta_i_deg,phi_deg,red,green,blue\n" + "\n".join(rows[:-20]) + "\n")
    with pytest.warns(UserWarning, match="few viewers are known|holes"):
        table, whole = Tabulated.load(path), Tabulated(r, t, p, f)
    assert 0 < table.holes < 0.02
    assert np.abs(table.values - whole.values).max() < 0.3 * whole.values.max()
    assert np.isclose(table.values, whole.values, rtol=1e-4).mean() > 0.97


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "holds no rows"),
        ("theta_r,theta_i,phi,f\n", "holds no rows"),
        ("theta_r,theta_i,phi,f\n1,2,3\n", "row 2 has 3 values, the header has 4"),
        ("theta_r,theta_i,phi,f\n1,2,3,x\n", "row 2 holds something that is not a number"),
        ("theta_r,theta_i,phi\n0,0,0\n", "no values beside its angles"),
        ("theta_r,theta_i,phi,f,sigma\n0,0,0,1,2\n", "has a column 'sigma' beside f"),
        ("theta_r,theta_i,phi,f_r,f_g\n0,0,0,1,2\n", "columns f_r, f_g are no channels"),
        ("theta,theta_i,phi,f\n0,0,0,1\n", "has no theta_r"),
        ("theta_r,theta_i,phi,f\n0,0,0,1\n0,0,0,2\n", "same angles as another"),
        ("theta_r,theta_i,phi,f\n" + "".join(f"{i / 99},{i / 98},{i / 97},1\n" for i in range(90)), "must form one grid"),
    ],
)
def test_a_csv_that_is_none_is_one_line(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text(text)
    with pytest.raises(ValueError, match=message) as caught:
        Tabulated.load(tmp_path / "t.csv")
    assert "\n" not in str(caught.value)


def test_an_npz_that_is_none_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "t.npz"
    with pytest.raises(ValueError, match=r"cannot read table .*t\.npz"):
        Tabulated.load(path)
    path.write_bytes(b"PK\x03\x04 not a zip")
    with pytest.raises(ValueError, match=r"not a whole \.npz"):
        Tabulated.load(path)
    np.savez(path, theta_r=[0.0], theta_i=[0.0], phi=[0.0])
    with pytest.raises(ValueError, match="has no f"):
        Tabulated.load(path)
    np.savez(path, theta_r=[0.0], theta_i=[0.0], phi=[0.0], f=np.array(["a"], object))
    with pytest.raises(ValueError, match="cannot read table"):
        Tabulated.load(path)
    with pytest.raises(ValueError, match=r"must be an \.npz or a \.csv"):
        Tabulated.load(tmp_path / "t.exr")


@pytest.mark.alone
def test_a_large_table_fits_in_time(tmp_path: Path) -> None:
    """91 x 181 x 361 x 3, loaded and fitted in another process: under 20 s of a processor and 2 GB."""
    program = """
import re, sys, time, numpy as np, cuticle
start = time.process_time()
table = cuticle.Tabulated.load(sys.argv[1])
fitted = cuticle.fit(table, 4)
most = re.search(r"VmHWM:\\s+(\\d+) kB", open("/proc/self/status").read())  # getrusage's also counts the parent's
print(time.process_time() - start, int(most[1]) / 1e6, fitted.ess.mean())
"""
    if not Path("/proc/self/status").exists():
        pytest.skip("the system does not tell a process's largest memory there")
    r, t, p, f = values(theta_r=np.linspace(-90, 90, 91), theta=np.linspace(-90, 90, 181), phi=np.linspace(-180, 180, 361))
    np.savez(tmp_path / "large.npz", theta_r=r, theta_i=t, phi=p, f=f)
    command = [sys.executable, "-c", program, str(tmp_path / "large.npz")]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    seconds, gigabytes, ess = map(float, done.stdout.split())
    assert seconds < 20
    assert gigabytes < 2
    assert ess > 0.98


def test_nothing_is_warned_of_without_cause(clean: Values) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Tabulated(*clean)
