"""Identification: how large, since when, and how sure.

Every onset stays in play with the probability the window gives it,

    p(o) ~ exp(GLR(o)) / sqrt(det a(o))        (flat in size and onset),

so that the size is the mean over all of them and its standard deviation holds what the onset leaves open; the onset
itself is the median, which has the smallest mean absolute error of all estimates. Where the onset is plain, this is the
size b / a with the standard deviation 1 / sqrt(a): the Cramer-Rao bound.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from fusiond.faults.forecast import errors_of
from fusiond.faults.glr import Fit, fit_signature, likelihoods, onset_weights
from fusiond.faults.ground import information
from fusiond.faults.hypotheses import Place
from fusiond.faults.response import Response
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Kind

ROUNDS = 2
"""Turns in which a scale and what it has done to the predictions settle; each leaves a share of their product."""
FEW = 4
"""Readings a rate of change is drawn through, at least."""


@dataclass(frozen=True, slots=True)
class Part:
    """The size of one part of a fault.

    Args:
        sensors, channels: that err by it; for an input sensor the numbers of the process inputs.
        size: in the unit of the kind: bias, spike: of the channel;   drift: of the channel per second;   scale: the
            factor readings come with;   noise: the factor of the standard deviation;   delay: s.   std: of the size.
    """

    sensors: Place
    channels: tuple[int, ...]
    size: float
    std: float


@dataclass(frozen=True, slots=True)
class Identity:
    """A fault described.

    Args:
        parts: one for each size.   onset_ns: stamp of the first reading it spoilt;   onset_std_s: of that.
        before: it may have begun before the window did.
    """

    kind: Kind
    parts: tuple[Part, ...]
    onset_ns: int
    onset_std_s: float
    before: bool

    @property
    def largest(self) -> Part:
        """The part that stands out most from its uncertainty."""
        usual = 1.0 if self.kind in (Kind.SCALE, Kind.NOISE) else 0.0
        return max(self.parts, key=lambda part: abs(part.size - usual) / max(part.std, 1e-300))


def _sizes(fit: Fit, weight: Vector) -> tuple[Vector, Vector]:
    """Mean and standard deviation of each size over all onsets."""
    if fit.kind is Kind.NOISE:
        return fit.size, np.sqrt(np.diagonal(fit.covariance))
    a, b = information(fit.ground, fit.hypothesis)
    sizes, _ = likelihoods(a, b)
    likely = weight > 1e-6
    spread: Matrix = np.diagonal(np.linalg.pinv(a[likely], hermitian=True), axis1=1, axis2=2)
    weight = weight[likely] / np.sum(weight[likely])
    mean = weight @ sizes[likely]
    return mean, np.sqrt(np.maximum(weight @ (spread + (sizes[likely] - mean) ** 2), 0.0))


def settled(fit: Fit) -> Fit:
    """A scale or delay fitted to what should have been read: the prediction less what the fault has moved it by."""
    if fit.kind not in (Kind.SCALE, Kind.DELAY):
        return fit
    response, refined = fit.ground.response, fit
    for _ in range(ROUNDS):
        moved = moved_predictions(refined)
        if fit.kind is Kind.SCALE:
            truer = replace(response, h=response.h - moved)
        else:
            truer = replace(response, hdot=rates_between(response, fit.place, moved, float(refined.size[0])))
        refined = fit_signature(replace(fit.ground, response=truer), fit.hypothesis)
    return refined


def rates_between(response: Response, place: Place, moved: Matrix, delay_s: float) -> Matrix:
    """(W, m) mean rate of change between measuring and stamping, (h(t) - h(t - delay)) / delay.

    From the predicted rates less what the fault has moved them by. Each is that of the interval before its entry, so it
    belongs to the middle of it. A channel whose predictions hop (a beacon at a time) keeps its rates as they are.
    """
    stamps = np.unique(response.t_s)
    before = stamps[np.maximum(np.searchsorted(stamps, response.t_s) - 1, 0)]
    middle, truer = 0.5 * (before + response.t_s), response.hdot.copy()
    for sensor in place:
        own = np.flatnonzero(response.sensor == sensor)
        t_s = response.t_s[own]
        if len(own) < FEW or np.any(np.diff(t_s) <= 0.0) or np.any(np.diff(middle[own]) <= 0.0):
            continue
        for channel in range(int(response.dof[own[0]])):
            h, rate = response.h[own, channel], response.hdot[own, channel]
            step = 0.5 * (rate[1:] + rate[:-1]) * np.diff(t_s)
            if np.median(np.abs(np.diff(h) - step)) > np.median(np.abs(step)):
                continue
            misled = CubicSpline(t_s, moved[own, channel])(middle[own], 1)
            travelled = CubicSpline(middle[own], rate - misled).antiderivative()
            back = np.maximum(t_s - delay_s, middle[own][0])
            late = np.abs(t_s - back) > 0.0
            truer[own[late], channel] = ((travelled(t_s) - travelled(back))[late]) / (t_s - back)[late]
    return truer


def moved_predictions(fit: Fit) -> Matrix:
    """(W, m) by how much the fault, of the fitted size, has moved the predicted raw readings."""
    response, steps = fit.ground.response, fit.ground.response.steps
    reading, driving = errors_of(fit, response)
    f, g = reading @ fit.size, driving @ fit.size
    moved, eps = np.zeros(response.h.shape), np.zeros(steps.error.shape[1])
    for k in range(fit.onset, len(response)):
        moved[k] = steps.seen[k] @ eps + steps.seen_input[k] @ g[k]
        eps = steps.error[k] @ eps + steps.reading[k] @ f[k] + steps.input[k] @ g[k]
    return moved


def identify(fit: Fit) -> Identity:
    """Size and onset of the fault that a fit stands for."""
    fit = settled(fit)
    ground, hypothesis = fit.ground, fit.hypothesis
    weight = onset_weights(fit.curve, fit.information)
    mean, std = _sizes(fit, weight)
    offset = 1.0 if fit.kind is Kind.SCALE else 0.0
    parts = tuple(
        Part(
            tuple(sorted({suspect.sensor for suspect in part})),
            tuple(sorted({suspect.channel for suspect in part})),
            float(mean[i]) + offset,
            float(std[i]),
        )
        for i, part in enumerate(hypothesis.parts)
    )
    t_ns = ground.response.t_ns[ground.entries]
    middle = int(np.searchsorted(np.cumsum(weight), 0.5))
    middle = min(middle, len(t_ns) - 1)
    t_s = (t_ns - t_ns[middle]) * 1e-9
    onset_std_s = float(np.sqrt(weight @ t_s**2))
    return Identity(fit.kind, parts, int(t_ns[middle]), onset_std_s, bool(weight[0] > 0.05))
