"""What waiting would bring: two explanations carried on into the readings to come.

The near future is taken to look like the recent past: the same sensors at the same rates, the same gains, the same
motion. Whether one explanation can still be told from another is then a number, not a guess: the part of the one's
signature, size as fitted, that no size of the other's can imitate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fusiond.faults.course import Suspect
from fusiond.faults.glr import Fit
from fusiond.faults.ground import profile_of
from fusiond.faults.response import Integers, Response
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Kind


@dataclass(frozen=True, slots=True)
class Separation:
    """Log likelihood by which one explanation is expected to outdo another.

    Args:
        now: in the window.   gain: more of it in the readings to come.
        strength: information of the fault itself in the last half of those;   sine2: squared sine between the two
            signatures there; 0: in the long run they look the same.
    """

    now: float
    gain: float
    strength: float
    sine2: float


def errors_of(fit: Fit, response: Response) -> tuple[Matrix, Matrix]:
    """(W, m, q) and (W, k, q): errors of each entry's channels and inputs for a unit of each size, time left out."""
    W, m = response.h.shape
    q, inputs = len(fit.hypothesis.parts), response.steps.input.shape[2]
    reading, driving = np.zeros((W, m, q)), np.zeros((W, inputs, q))
    for i, part in enumerate(fit.hypothesis.parts):
        for suspect in part:
            if suspect.is_input:
                driving[:, suspect.channel, i] = 1.0
                continue
            own = response.sensor == suspect.sensor
            if fit.kind is Kind.SCALE:
                reading[own, suspect.channel, i] = response.h[own, suspect.channel]
            elif fit.kind is Kind.DELAY:
                reading[own, suspect.channel, i] = -response.hdot[own, suspect.channel]
            else:
                reading[own, suspect.channel, i] = 1.0
    return reading, driving


def worst_error(fit: Fit, doubts: float = 0.0) -> dict[Suspect, float]:
    """Largest error the fitted fault makes in the window, of each channel and input it sits in, in its unit.

    Args:
        doubts: standard deviations by which every size is taken to be smaller than it looks.
    """
    response = fit.ground.response
    size = np.maximum(np.abs(fit.size) - doubts * np.sqrt(np.diagonal(fit.covariance)), 0.0)
    reading, driving = errors_of(fit, response)
    f, g = np.abs(reading)[fit.onset :] @ size, np.abs(driving)[fit.onset :] @ size
    if fit.kind is Kind.DRIFT:
        since_s = response.t_s[fit.onset :, np.newaxis] - response.t_s[fit.onset]
        f, g = f * since_s, g * since_s
    return {
        suspect: float(np.max((g if suspect.is_input else f)[:, suspect.channel], initial=0.0))
        for part in fit.hypothesis.parts
        for suspect in part
    }


def onward_means(fits: Sequence[Fit], count: int) -> tuple[list[Matrix], Integers]:
    """Whitened means of the next `count` entries for a unit of each size of every fit.

    Returns:
        For each fit (rows, q), and (count + 1,) the row at which each entry begins.
    """
    response, steps = fits[0].ground.response, fits[0].ground.response.steps
    W = len(response)
    recent = max(W // 2, 1)
    phi = np.hstack(
        [
            response.carried[:, fit.ground.columns] @ profile_of(fit.ground, fit.hypothesis, fit.number)
            for fit in fits
        ]
    )
    step_s = (response.t_s[-1] - response.t_s[-recent]) / max(recent - 1, 1)
    widths = [len(fit.size) for fit in fits]
    now = np.concatenate([np.full(q, _grown(fit)) for fit, q in zip(fits, widths, strict=True)])
    each = np.concatenate(
        [np.full(q, step_s * (fit.kind is Kind.DRIFT)) for fit, q in zip(fits, widths, strict=True)]
    )
    errors = [errors_of(fit, response) for fit in fits]
    reading, driving = (np.concatenate([pair[i] for pair in errors], axis=2)[W - recent :] for i in (0, 1))
    late = slice(W - recent, W)
    shown = steps.from_reading[late] @ reading + steps.from_input[late] @ driving
    caused = steps.reading[late] @ reading + steps.input[late] @ driving
    dof = response.dof[late][np.arange(count) % recent]
    row = np.concatenate(([0], np.cumsum(dof)))
    means = np.empty((row[-1], phi.shape[1]))
    for i in range(count):
        k = i % recent
        grown = now + (i + 1) * each
        means[row[i] : row[i + 1]] = (steps.from_error[W - recent + k] @ phi + shown[k] * grown)[: dof[i]]
        phi = steps.error[W - recent + k] @ phi + caused[k] * grown
    ends = np.cumsum(widths)
    return [means[:, end - q : end] for end, q in zip(ends, widths, strict=True)], row


def _grown(fit: Fit) -> float:
    """What a unit of size amounts to at the window's end."""
    response = fit.ground.response
    if fit.kind is Kind.DRIFT:
        return float(response.t_s[-1] - response.t_s[fit.onset])
    return float(fit.kind is not Kind.SPIKE)


def _unlike(mean: Vector, basis: Matrix) -> Vector:
    """What the columns of `basis` cannot imitate of `mean`."""
    scale = np.sqrt(np.sum(basis * basis, axis=0))
    unit = basis[:, scale > 0.0] / scale[scale > 0.0]
    return mean - unit @ np.linalg.lstsq(unit, mean, rcond=1e-9)[0] if unit.size else mean


def _energy(mean: Vector) -> float:
    """Information of whitened means: log likelihood ratio they are expected to yield."""
    return 0.5 * float(mean @ mean)


def separate(fit: Fit, rivals: Sequence[Fit], counts: Sequence[int]) -> list[Separation]:
    """How well `fit`, if it is true, is told from each rival in the window, and in so many more entries."""
    if not rivals:
        return []
    (own, *others), row = onward_means([fit, *rivals], max(counts))
    mean, later = fit.basis() @ fit.size, own @ fit.size
    return [
        _apart(mean, rival.basis(), later[: row[count]], other[: row[count]])
        for rival, other, count in zip(rivals, others, counts, strict=True)
    ]


def _apart(mean: Vector, basis: Matrix, later: Vector, basis_later: Matrix) -> Separation:
    """How well a mean is told from what `basis` can imitate, in the window and with the readings to come."""
    now = _energy(_unlike(mean, basis))
    rest = _unlike(np.concatenate((mean, later)), np.concatenate((basis, basis_later)))
    tail = (len(later) + 1) // 2
    strength = _energy(later[-tail:])
    sine2 = (
        _energy(_unlike(later[-tail:], basis_later[-tail:])) / strength if tail and strength > 0.0 else 0.0
    )
    return Separation(now, max(_energy(rest) - now, 0.0), strength, sine2)
