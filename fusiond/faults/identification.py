"""Identification: how large, since when, and how sure.

Every onset stays in play with the probability the window gives it,

    p(o) ~ exp(GLR(o)) / sqrt(det a(o))        (flat in size and onset),

so that the size is the mean over all of them and its standard deviation holds what the onset leaves open; the onset
itself is the median, which has the smallest mean absolute error of all estimates. Where the onset is plain, this is the
size b / a with the standard deviation 1 / sqrt(a): the Cramer-Rao bound.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fusiond.faults.glr import Fit, likelihoods
from fusiond.faults.ground import information
from fusiond.faults.hypotheses import Place
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Kind


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


def onset_weights(curve: Vector, information: Vector) -> Vector:
    """(o,) probability of each onset from its log likelihood ratio and the determinant of its information."""
    known = information > 0.0
    logs = np.where(known, curve - 0.5 * np.log(np.where(known, information, 1.0)), -np.inf)
    if not np.any(known):
        logs = curve
    weight = np.exp(logs - np.max(logs))
    return weight / np.sum(weight)


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
    return mean, np.sqrt(weight @ (spread + (sizes[likely] - mean) ** 2))


def identify(fit: Fit) -> Identity:
    """Size and onset of the fault that a fit stands for."""
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
