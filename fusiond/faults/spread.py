"""Noise that is not what was declared: of one sensor, or of everything at once.

A sensor whose noise is `factor` times the declared one gives the innovations the covariance I + v Z Z',
v = factor^2 - 1, with Z what a unit of its own noise in each reading does to them, at once and later. In the
eigenvectors of Z'Z (eigenvalues l, coordinates y of e) the log likelihood ratio is exact and cheap for every v:

    LLR(v) = 1/2 sum [y^2 v l / (1 + v l) - ln(1 + v l)].

The onset is sought in the sensor's own innovations: n/2 (s - 1 - ln s), s their mean square since.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fusiond.faults.ground import Ground
from fusiond.faults.response import Integers, Response
from fusiond.numerics.ud import Matrix, Vector

FACTORS = np.geomspace(0.03, 300.0, 41)
"""Factors of the noise among which the likelihood's summit is first looked for."""
MOST = 160
"""Scalar readings, the newest, whose noise is followed exactly."""


@dataclass(frozen=True, slots=True)
class Spread:
    """A change of noise from entry `onset` on by `factor`; removed: of the sum of squares; curve: LLR of each onset."""

    onset: int
    factor: float
    factor_var: float
    glr: float
    removed: float
    curve: Vector


def scatter_curve(e: Vector, at: Integers, count: int, least: float = 1e-12) -> Vector:
    """(count,) LLR of a changed mean square of e from each entry on.

    Args:
        at: (E,) entry of each e, each occurs.   least: a smaller mean square counts as this.
    """
    each = np.bincount(at, minlength=count).astype(np.float64)
    total = np.bincount(at, weights=e * e, minlength=count)
    n = np.cumsum(each[::-1])[::-1]
    s = np.maximum(np.cumsum(total[::-1])[::-1] / n, least)
    return 0.5 * n * (s - 1.0 - np.log(s))


def fit_factor(gram: Matrix, matched: Vector) -> tuple[float, float, float, float]:
    """Most likely factor of the noise behind Z, its variance, its log likelihood ratio, and what it explains of e'e.

    Args:
        gram: Z'Z.   matched: Z'e.
    """
    lengths, V = np.linalg.eigh(gram)
    kept = lengths > 1e-12 * max(float(lengths[-1]), 1e-300)
    # the declared noise is part of a unit covariance, so no eigenvalue passes 1 but by rounding
    share = np.minimum(lengths[kept], 1.0)
    y2 = (V[:, kept].T @ matched) ** 2 / lengths[kept]
    factors = FACTORS
    for _ in range(3):
        vl = (factors[:, None] ** 2 - 1.0) * share
        llr = 0.5 * np.sum(y2 * vl / (1.0 + vl) - np.log1p(vl), axis=1)
        best = int(np.argmax(llr))
        around = factors[max(best - 1, 0)], factors[min(best + 1, len(factors) - 1)]
        factor, glr = float(factors[best]), float(llr[best])
        factors = np.geomspace(*around, 21)
    fisher = 0.5 * float(np.sum((share / (1.0 + (factor**2 - 1.0) * share)) ** 2))
    vl = (factor**2 - 1.0) * share
    removed = float(np.sum(y2 * vl / (1.0 + vl)))
    return factor, 1.0 / max(4.0 * factor**2 * fisher, 1e-300), max(glr, 0.0), removed


def fit_spread(ground: Ground) -> Spread:
    """A change of noise of the sensors of one place that update."""
    response = ground.response
    # readings folded together have no scatter of their own to be told
    least = int(np.max(np.flatnonzero(~ground.alone), initial=-1)) + 1
    rows = np.flatnonzero(np.isin(response.entry, ground.entries[least:]))
    at = np.searchsorted(ground.entries, response.entry[rows])
    curve = scatter_curve(response.e[rows], at - least, len(ground.entries) - least)
    curve = np.concatenate((np.zeros(least), curve))
    start = max(int(np.argmax(curve)), int(ground.at[-MOST:][0]), least)
    own = slice(int(ground.first[start]), None)
    gram, matched = ground.gram[own, own], ground.matched[own]
    wide = np.zeros((len(matched), len(matched)))
    place = 0
    for k in ground.entries[start:]:
        dof = int(response.dof[k])
        wide[place : place + dof, place : place + dof] = response.noise[k, :dof, :dof]
        place += dof
    onset = int(ground.entries[max(int(np.argmax(curve)), least)])
    return Spread(onset, *fit_factor(wide.T @ gram @ wide, wide.T @ matched), curve)


def pooled(response: Response) -> float:
    """LLR of all innovations scattering more from some entry on: what a wrong model does to every sensor.

    Less than declared is what a cautious configuration looks like from the first reading on, and convicts nobody.
    """
    entries = np.unique(response.entry)
    at = np.searchsorted(entries, response.entry)
    return float(np.max(scatter_curve(response.e, at, len(entries), least=1.0), initial=0.0))
