# The compiled core (src/native). Arrays are contiguous; results are written into the arrays handed in.
from collections.abc import Callable
from typing import Any

from numpy.typing import NDArray

average_columns: int

def in_one_line(function: Callable[[Any], Any], argument: Any) -> Any: ...
def azimuthal_tables(
    eta: float,
    sigma_a: NDArray,
    logistic: bool,
    beta_n: float,
    closed: bool,
    offsets: int,
    direct: NDArray,
    spread: NDArray,
    halves: NDArray,
) -> None: ...
def averages(
    alpha: NDArray, beta: NDArray, exact: bool, d_b: float, limit: float, quadrature: int, halves: NDArray, out: NDArray
) -> None: ...  # fmt: skip
def backscatter(
    a_f: float, a_b: float, alpha_f: float, alpha_b: float, beta_f: float, beta_b: float, exact: bool, d_b: float
) -> tuple[float, float, float]: ...
def energy_conserving_m(theta_i: NDArray, cone: NDArray, variance: NDArray, out: NDArray) -> None: ...

far_cells: int

def cell_geometry(dense: bool, out: NDArray) -> None: ...
def longitudinal_deviation(beta_m: float) -> float: ...
def color_divisor(beta_n: NDArray, out: NDArray) -> None: ...
def azimuthal_scale(beta_n: float) -> float: ...
def far_eval(
    chiang: bool,
    parameters: NDArray,
    sigma_a: NDArray,
    luminance: NDArray,
    theta_i: NDArray,
    theta_r: NDArray,
    phi: NDArray,
    f: NDArray,
    pdf: NDArray,
) -> None: ...
def far_sample(
    chiang: bool,
    parameters: NDArray,
    sigma_a: NDArray,
    luminance: NDArray,
    theta_r: NDArray,
    u: NDArray,
    theta_i: NDArray,
    phi: NDArray,
    f: NDArray,
    pdf: NDArray,
) -> None: ...
def rest_energies(eta: float, sigma_a: NDArray, offsets: int, out: NDArray) -> None: ...

class _Among:
    def __init__(
        self,
        lobes: NDArray,
        azimuth: NDArray,
        behind: NDArray,
        limit: float,
        tilt: NDArray,
        variance: NDArray,
        d_f: float,
        d_b: float,
    ) -> None: ...
    def eval(
        self,
        chiang: bool,
        parameters: NDArray,
        sigma_a: NDArray,
        luminance: NDArray,
        theta_i: NDArray,
        theta_r: NDArray,
        phi: NDArray,
        strands: NDArray,
        behind: NDArray,
        random: bool,
        f: NDArray,
        pdf: NDArray,
    ) -> None: ...
    def sample(
        self,
        chiang: bool,
        parameters: NDArray,
        sigma_a: NDArray,
        luminance: NDArray,
        theta_r: NDArray,
        u: NDArray,
        strands: NDArray,
        behind: NDArray,
        random: bool,
        theta_i: NDArray,
        phi: NDArray,
        f: NDArray,
        pdf: NDArray,
    ) -> None: ...

class AmongDouble(_Among): ...
class AmongFloat(_Among): ...

class ChiangNear:
    def __init__(
        self, eta: float, scale: float, variance: NDArray, tilt: NDArray, sigma_a: NDArray, luminance: NDArray
    ) -> None: ...
    def eval(self, theta_i: NDArray, theta_r: NDArray, phi: NDArray, h: NDArray, lobes: int, out: NDArray) -> None: ...
    def pdf(self, theta_i: NDArray, theta_r: NDArray, phi: NDArray, h: NDArray, out: NDArray) -> None: ...
    def sample(self, theta_r: NDArray, u: NDArray, h: NDArray, theta_i: NDArray, phi: NDArray, density: NDArray) -> None: ...

class Model:
    def __init__(self, alpha: NDArray, beta: NDArray, *tables: Any) -> None: ...
    def eval(self, theta_i: NDArray, theta_r: NDArray, phi: NDArray, strands: NDArray, lobes: int, out: NDArray) -> None: ...
    def expected(
        self, theta_i: NDArray, theta_r: NDArray, phi: NDArray, strands: NDArray, behind: NDArray, lobes: int, out: NDArray
    ) -> None: ...  # fmt: skip

class Table:
    def __init__(self, shape: NDArray, log_energy: NDArray, strands: NDArray, reach: float, even: bool) -> None: ...
    def eval(self, theta_i: NDArray, theta_r: NDArray, phi: NDArray, strands: NDArray, out: NDArray) -> None: ...

def fresnel(cos_i: float, eta: float) -> float: ...
def i0_scaled(x: float) -> float: ...
def longitudinal_normal(function: int, x: NDArray, mean: NDArray, sigma: NDArray, out: NDArray) -> None: ...
def periodic_normal(function: int, x: NDArray, mean: NDArray, sigma: NDArray, out: NDArray) -> None: ...
def even_normal(function: int, x: NDArray, mean: NDArray, sigma: NDArray, out: NDArray) -> None: ...
def normal_equations(
    q: NDArray, theta: NDArray, theta_weight: NDArray, phi: NDArray, phi_weight: NDArray, parameters: NDArray, even: bool,
    allowed: float, price: float, loss: NDArray, gradient: NDArray, hessian: NDArray, family: str = "normal"
) -> None: ...  # fmt: skip

lobe_families: tuple[str, ...]

def first_outside(x: NDArray, low: float, high: float, open_end: bool) -> int: ...
def histogram(theta: NDArray, phi: NDArray, theta_edges: NDArray, phi_edges: NDArray, counts: NDArray) -> int: ...

density_columns: int

def density_grid(
    points: NDArray, radius: NDArray, offsets: NDArray, lower: NDArray, cell: NDArray, cells: NDArray
) -> None: ...
def count_strands(
    cells: NDArray, lower: NDArray, cell: NDArray, origin: NDArray, direction: NDArray, distance: NDArray, out: NDArray
) -> None: ...
