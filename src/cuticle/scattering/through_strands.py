"""Tables of what comes to a fibre through other strands: what the core's `exact` dual scattering looks up."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cuticle._support.interpolation import monotone
from cuticle.scattering.azimuthal import azimuthal_tables
from cuticle.scattering.chiang import Chiang
from cuticle.scattering.fibre import Fibre
from cuticle.scattering.fibre_tables import ThroughTables
from cuticle.scattering.longitudinal_mixtures import longitudinal_mixtures, m_in_rows
from cuticle.scattering.strand_transport import PASSED, Directions, Scattering, StrandTransport, azimuth_cells

Array = NDArray[np.float64]
# The core's nodes, 0, 1, 2, 4, 8 and 16 strands, and halfway between them.
_COUNTS = (0, 1, 2, 3, 4, 6, 8, 12, 16)
_DEPTHS = (0, 1 / 16, 1 / 8, 1 / 2, 1, 3 / 2, 2, 3, 4, 6, 8, 12, 16)
# Of these, the core's nodes and what is known halfway from one to the next, the node itself where nothing is.
_SHEETS = [0, 1, 2, 4, 6, 8], [0, 1, 3, 5, 7]
_RANDOM = [0, 1, 4, 6, 8, 10, 12], [0, 3, 5, 7, 9, 11]
_NODES = {len(_COUNTS): _SHEETS, len(_DEPTHS): _RANDOM}
ALONG_ROWS = 2  # rows of the transport for one of the table of M's
AZIMUTH_ROWS = 4  # rows of the transport for one of the azimuth table
COUNTED_2 = 2  # of the nodes for sheets, that of 2 of them
_DARKEST = -230.0  # ln of the least energy that keeps its shape
_APART = math.log(1.6)  # between absorptions that are solved; those between are interpolated
_OWN = 3  # the first, which are a fibre's own where a range for textures follows, are always solved


def through_tables(fibre: Fibre | Chiang, *, random: str | None = "lock") -> ThroughTables:
    """Return the tables of a fibre, one column an absorption: for sheets, and for a random number of strands.

    `random`: "lock", "medium", or None for sheets alone, which are half the work; then the first axes are 1 long. Of
    Chiang's fibres the orders past TRT are in TRT.
    """
    sheets = _sheets(_plain(fibre)).through
    if random is None:
        return sheets
    both = zip(sheets[:3], _random(_plain(fibre), random), strict=True)
    # Direct light, the first of each: it is sent back by sheets, as by a lock, or by a medium.
    halves = ([np.concatenate([r[:, :1], s[:, 1:]], axis=1), r[:, 1:]] for s, r in both)
    energy, along, azimuth = map(np.concatenate, halves)
    return ThroughTables(energy, along, azimuth, sheets.behind, sheets.limit)


def passed_through(fibre: Fibre | Chiang) -> tuple[Array, float]:
    """Return `transmittance_table` of a fibre, one column an absorption, and the largest inclination of its rows."""
    return _passed(_plain(fibre)), float(Directions().theta[-1])


def own_energies(fibre: Fibre | Chiang) -> Array:
    """Return what a strand on its own scatters by R, TT and TRT, out of 1, in the rows of `through_tables`.

    Shape (rows, 3, channels); at least exp(-230), as in the tables.
    """
    return np.exp(_sheets(_plain(fibre)).log_own)


class _Sheets(NamedTuple):
    through: ThroughTables
    log_own: Array


def _plain(fibre: Fibre | Chiang) -> Fibre | Chiang:
    """Without what does not change the tables."""
    if isinstance(fibre, Chiang):
        return fibre.with_absorption(fibre.absorption)
    return fibre.replace(d_f=1.0, d_b=1.0, formulation="exact", sigma_a=fibre.absorption)


@lru_cache(maxsize=16)
def _sheets(fibre: Fibre | Chiang) -> _Sheets:
    energy, along, azimuth, behind, log_own = _columns(fibre, _through_sheets)
    return _Sheets(ThroughTables(energy, along, azimuth, behind, float(Directions().theta[-1])), log_own)


@lru_cache(maxsize=16)
def _random(fibre: Fibre | Chiang, arrangement: str) -> list[Array]:
    return _columns(fibre, lambda transport: _through_random(transport, arrangement == "medium"))


def _columns(fibre: Fibre | Chiang, column: Callable[[StrandTransport], tuple[Array, ...]]) -> list[Array]:
    """Tables of one arrangement of strands, for all absorptions, with a first axis of 1.

    `column` returns those of one absorption, without the first axis and the last; in place of the second's M's, the logs of
    energies over theta_i, of all that it has followed.
    """
    absorption = np.array(fibre.absorption)
    solved, theta = _solved(absorption), Directions().theta
    columns = map(column, _transports(fibre))  # not in threads: linear algebra has its own, which they would slow
    energy, log_along, *others = (_between(solved, np.stack(x, axis=-1), absorption) for x in zip(*columns, strict=True))
    seen = np.exp(log_along).transpose(2, 0, 4, 1, 3)  # (theta_r, strands, absorptions, parts, theta_i)

    def mixtures(energy: Array) -> Array:
        nodes, halfway = _NODES[len(log_along)]  # the first, of direct light, is of another kind
        each = (nodes[:1], halfway[:0]), (nodes[1:], halfway[1:])
        return np.concatenate([longitudinal_mixtures(theta, theta[::ALONG_ROWS], energy, *x) for x in each], axis=1)

    found = mixtures(seen[:, :, None, :_OWN])[:, :, 0]
    if len(absorption) > _OWN:  # a range, between which the core interpolates
        order = np.argsort(absorption[_OWN:])
        found = np.append(found, mixtures(seen[:, :, _OWN:][:, :, order])[:, :, np.argsort(order)], axis=2)
    along = found.transpose(1, 0, 4, 3, 2)
    tables = [energy[None], along[None], others[0][None], *others[1:]]
    for table in tables:
        table.setflags(write=False)
    return tables


@lru_cache(maxsize=1)  # for the other tables of the same fibre
def _transports(fibre: Fibre | Chiang) -> list[StrandTransport]:
    absorption = np.array(fibre.absorption)
    return [StrandTransport(_parts(fibre, int(np.argmax(absorption == a)), Directions())) for a in _solved(absorption)]


@lru_cache(maxsize=16)
def _passed(fibre: Fibre | Chiang) -> Array:
    absorption = np.array(fibre.absorption)
    passed = np.stack([transport.passed() for transport in _transports(fibre)], axis=-1)
    table = _between(_solved(absorption), transmittance_table(passed), absorption)
    table.setflags(write=False)
    return table


def _solved(absorption: Array) -> Array:
    """Absorptions to solve: of many, those as far apart as interpolation in their logs bridges, and the fibre's own."""
    kept = sorted({*absorption[:_OWN]})
    for a in sorted({*absorption}):
        if a in (absorption.min(), absorption.max()) or all(x <= 0 or abs(math.log(a / x)) >= _APART for x in kept if a > 0):
            kept.append(a)
    return np.array(sorted({*kept}))


def _between(solved: Array, values: Array, absorption: Array) -> Array:
    """Values of all absorptions, by what lies monotonically between those solved, over their logs."""
    positive = solved > 0
    if positive.sum() < 2 or {*absorption} <= {*solved}:
        return values[..., np.searchsorted(solved, absorption)]
    over_logs = monotone(np.log(solved[positive]), values[..., positive], axis=-1)
    out = over_logs(np.log(np.maximum(absorption, solved[positive][0])))
    out[..., absorption <= 0] = values[..., :1]
    return out


def _through_sheets(transport: StrandTransport) -> tuple[Array, ...]:
    """Columns of energy, of energies over theta_i (nodes, parts, rows, rows), of azimuth, of `behind`, of own energies."""
    seen = transport.through_sheets(np.eye(transport.directions.rows), _COUNTS)
    # Nodes: 0, 1, 2, 4, 8, 16 strands; of 0 there is direct light's backscatter. Of a whole number of sheets there is none
    # halfway from 1 to 2: the parabola through 1, 2 and 3 knows it.
    nodes, halfway = _SHEETS
    total = seen.sum(axis=-1)
    one, two, three = total[1:4]
    half = np.exp((3 * _log(one) + 6 * _log(two) - _log(three)) / 8)
    log_own = _log(np.array([p.energy[::-1] for p in transport.parts]).T)
    tables = _of_parts(transport.directions, seen, nodes, np.stack([one, half, *total[halfway[2:]]]))
    tables[0][0, :, 1] = 0  # from none to one nothing is interpolated
    return *tables, transport.one_behind()[:, ::-1].T, log_own


def _through_random(transport: StrandTransport, medium: bool) -> tuple[Array, ...]:
    """The same of energy, of energies over theta_i, and of azimuth, for direct light and a Poisson number of strands."""
    seen = _scattered(transport.through_random(np.eye(transport.directions.rows), _DEPTHS, medium=medium))
    nodes, halfway = _RANDOM
    tables = _of_parts(transport.directions, seen, nodes, seen[halfway].sum(axis=-1))
    tables[0][0, :, 1] = 0
    return tables


def transmittance_table(passed: Array) -> Array:
    """Return ln of what hair passes on of light, (2, 6, rows, channels), from `StrandTransport.passed` of channels.

    The core's TransmittanceTable views it (through_strands.h): of sheets, and of a Poisson number of them that is not 0; for
    0 (sheets: 1; a random number: the limit), 1, 2, 4, 8 and 16 strands.
    """
    logs = _log(passed)[:, ::-1]  # rows were directions of travel
    sheets = 2 ** np.arange(PASSED + 1)
    numbers, slots = np.arange(1, sheets[-1] + 1), sheets[:5]
    # Light falls as 1/(1 + c n) or as a power: nearly straight in ln n either way, between numbers so close.
    each = np.exp(monotone(np.log(sheets), logs)(np.log(numbers)))
    shares = np.array([poisson_shares(numbers, n) for n in (1e-6, *slots)])
    random = np.tensordot(shares / shares.sum(axis=1, keepdims=True), each, 1)
    return np.array([logs[[0, *range(len(slots))]], _log(random)])


def poisson_shares(numbers: NDArray[np.int_], mean: float) -> Array:
    """Return the probabilities of 1, 2, 3, … of a Poisson number: SciPy's statistics take a second to import."""
    return np.exp(numbers * math.log(mean) - mean - np.cumsum(np.log(numbers)))


def _log(moments: Array) -> Array:
    return np.log(np.maximum(moments, math.exp(_DARKEST)))


def _scattered(random: Array) -> Array:
    """What comes through a random number of strands that scatter it, out of 1, less direct light's backscatter."""
    lit = np.exp(-np.array(_DEPTHS[1:]))[:, None, None, None]
    out = random.copy()
    out[1:, -1] -= lit * random[0, -1]
    out[1:] /= (1 - lit)[..., None]
    out[1] = 2 * out[1] - out[2]  # the limit of no strands
    return out


def _parts(fibre: Fibre | Chiang, channel: int, d: Directions) -> list[Scattering]:
    """R, TT and TRT, each a product of N_p at the viewer's inclination and M_p."""
    if isinstance(fibre, Chiang):
        direct, (alpha, beta) = fibre.tables.direct, fibre.half_angle_lobes
    else:
        direct = azimuthal_tables(fibre.eta, fibre.absorption, float(np.radians(fibre.beta_N)), True).direct
        alpha, beta = fibre.alpha, fibre.beta
    rows, columns = (np.linspace(0, end, n) for end, n in zip((np.pi / 2, np.pi), direct.shape, strict=False))
    parts = []
    for p in range(3):
        along = np.array([np.interp(d.fine_phi, columns, row) for row in direct[..., p, channel]])
        density = np.array([np.interp(np.abs(d.theta), rows, column) for column in along.T]).T
        parts.append(_part(d, density, 2 * alpha[p], 4 * beta[p] ** 2))
    if isinstance(fibre, Chiang):
        rest = np.interp(np.abs(d.theta), np.linspace(0, np.pi / 2, len(fibre.rest)), fibre.rest[:, channel])
        even = np.repeat(rest[:, None] / (2 * np.pi), len(d.fine_phi), axis=1)
        parts[2] = parts[2] + _part(d, even, 0.0, float(fibre.variance[3]))
    return parts


def _part(d: Directions, density: Array, tilt: float, variance: float) -> Scattering:
    """A product of densities of phi, (rows, fine_phi), and of an M."""
    cell, point = azimuth_cells(d, density)
    into = m_in_rows(d.fine_theta, d.theta + tilt, np.full(d.rows, variance)).reshape(d.rows, d.rows, -1).sum(axis=2)
    return Scattering(d, cell[:, :, None] * into, point[:, :, None] * into)


def _of_parts(d: Directions, seen: Array, nodes: list[int], halfway: Array) -> tuple[Array, Array, Array]:
    """The tables of energy and of azimuths at nodes, and between them logs of energies over theta_i, from energies.

    `seen`: (numbers of strands, parts, azimuths, rows, rows of theta_i). `halfway`: those of all theta_i halfway to the next
    node.
    """
    seen, halfway = seen[..., ::-1, :], halfway[..., ::-1]  # rows are directions of travel: theta_r is their other sign
    along = np.maximum(np.einsum("sjnrt,n->sjrt", seen, d.node_weights), 0)
    log_energy = _log(along[nodes].sum(axis=-1)).swapaxes(1, 2)
    bend = np.zeros(log_energy.shape)
    between = _log(np.einsum("sjnr,n->srj", halfway, d.node_weights))
    bend[:-1] = between - 0.5 * (log_energy[:-1] + log_energy[1:])
    density = np.maximum(np.moveaxis(seen[nodes].sum(axis=-1), (1, 3), (3, 1))[:, ::AZIMUTH_ROWS], 0)
    total = np.einsum("srnj,n->srj", density, d.node_weights)[:, :, None]
    uniform = total <= math.exp(_DARKEST)
    azimuth = np.where(uniform, 0.5 / np.pi, density / np.where(uniform, 1, total))
    return np.stack([log_energy, bend], axis=2), _log(along[:, :, ::ALONG_ROWS]), azimuth
