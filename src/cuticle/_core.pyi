# The compiled core (src/native). Arrays are contiguous; results are written into the arrays handed in.
from typing import Any

from numpy.typing import NDArray

average_columns: int

def azimuthal_tables(
    eta: float,
    sigma_a: NDArray,
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

class Model:
    def __init__(self, alpha: NDArray, beta: NDArray, energy_conserving: bool, direct: NDArray, *dual: Any) -> None: ...
    def eval(self, theta_i: NDArray, theta_r: NDArray, phi: NDArray, strands: NDArray, lobes: int, out: NDArray) -> None: ...

def fresnel(cos_i: float, eta: float) -> float: ...
def i0_scaled(x: float) -> float: ...
def longitudinal_normal(function: int, x: NDArray, mean: NDArray, sigma: NDArray, out: NDArray) -> None: ...
def periodic_normal(function: int, x: NDArray, mean: NDArray, sigma: NDArray, out: NDArray) -> None: ...
def even_normal(function: int, x: NDArray, mean: NDArray, sigma: NDArray, out: NDArray) -> None: ...
def normal_equations(
    q: NDArray, theta: NDArray, theta_weight: NDArray, phi: NDArray, phi_weight: NDArray, parameters: NDArray, even: bool,
    loss: NDArray, gradient: NDArray, hessian: NDArray
) -> None: ...  # fmt: skip
def first_outside(x: NDArray, low: float, high: float, open_end: bool) -> int: ...
def histogram(theta: NDArray, phi: NDArray, theta_edges: NDArray, phi_edges: NDArray, counts: NDArray) -> int: ...
def kernel_cost(x: NDArray) -> float: ...
def uniform_cost(u: NDArray) -> float: ...

density_columns: int

def density_grid(
    points: NDArray, radius: NDArray, offsets: NDArray, lower: NDArray, cell: NDArray, cells: NDArray
) -> None: ...
def count_strands(
    cells: NDArray, lower: NDArray, cell: NDArray, origin: NDArray, direction: NDArray, distance: NDArray, out: NDArray
) -> None: ...
