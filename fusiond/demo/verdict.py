"""The verdict on a demonstration: four promises, each measured against its limit."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.recording.diff import Reports
from fusiond.recording.digest import OutputDigest
from fusiond.recording.summary import Summary
from fusiond.recording.truth import Truth
from fusiond.types import NANOSECONDS, TICK

HOLDS_GOAL_M = 2.5e-3
"""RMS distance from the goal over the last ten seconds: the promise for seed 0 of the noise."""
PROMISED_STAY_S = 10.0
ANY_RUN_M = 8e-3
"""The same for any other seed, and for a shorter stay. The noise alone puts one run in eight further off than 2.5 mm;
of 400 seeds of either plant none was off by more than 3.9 mm over ten seconds, 6.5 mm over three."""
REACHED_S = 15.0
"""From 2 m away the saturated loop is within a millimetre after this time."""
SHORTEST_S = 3.0
"""Shortest stay at the goal that is judged."""
CONFIDENCE = 0.999
"""Probability with which a consistent filter passes each of its two tests."""


@dataclass(frozen=True, slots=True)
class Check:
    """One promise. `ok` None: the run was too short to ask."""

    name: str
    ok: bool | None
    text: str

    def json_object(self) -> dict[str, Any]:
        """For `demo --json`."""
        return {"name": self.name, "ok": self.ok, "text": self.text}


@dataclass(frozen=True, slots=True)
class Verdict:
    """All of them."""

    checks: tuple[Check, ...]

    @property
    def ok(self) -> bool:
        """Whether none fails."""
        return all(check.ok is not False for check in self.checks)

    def json_object(self) -> dict[str, Any]:
        """For `demo --json`."""
        return {"ok": self.ok, "checks": [check.json_object() for check in self.checks]}


def goal_check(truth: Truth, goal_m: float, seed: int) -> Check:
    """The true position over the last third, from when the goal can have been reached."""
    t_s = truth.t_ns / NANOSECONDS
    end_s = float(t_s[-1])
    begin_s = max(end_s - max(PROMISED_STAY_S, end_s / 3.0), REACHED_S)
    stay_s = end_s - begin_s
    if stay_s < SHORTEST_S:
        return Check(
            "goal", None, f"run at least {REACHED_S + SHORTEST_S:g} s: reaching it takes {REACHED_S:g} s"
        )
    late = t_s >= begin_s
    position_m = truth.values[late, truth.names.index("position")]
    rms_m = math.sqrt(float(np.mean((position_m - goal_m) ** 2)))
    limit_m = HOLDS_GOAL_M if seed == 0 and stay_s >= PROMISED_STAY_S else ANY_RUN_M
    text = f"{1e3 * rms_m:.2f} mm RMS from {goal_m:g} m over the last {stay_s:.1f} s (limit {1e3 * limit_m:g} mm)"
    return Check("goal", rms_m <= limit_m, text)


def end_check(summary: Summary, truth: Truth) -> Check:
    """Where the estimate ends, against where the truth does: every state that truth has within its own limits."""
    from scipy.special import ndtri

    state, std = summary.final.get("state", {}), summary.final.get("std", {})
    names = [name for name in truth.names if name in std]
    if not names:
        return Check("end", False, "no state that could be compared with truth")
    # one of them may be the unlucky one
    limit = float(-ndtri(0.5 * (1.0 - CONFIDENCE) / len(names)))
    texts, holds = [], True
    for name in names:
        column = truth.names.index(name)
        error = float(state[name] - truth.values[-1, column])
        if truth.angles[column]:
            error = math.remainder(error, 2.0 * math.pi)
        holds &= abs(error) <= limit * std[name]
        texts.append(f"{name} {error:+.4g} ({std[name]:.2g})")
    return Check(
        "end", holds, f"errors, each with its reported std (limit {limit:.1f} of them): {', '.join(texts)}"
    )


def consistency_check(summary: Summary, dofs: Mapping[str, int], *, own_noise: bool = True) -> Check:
    """Errors as large as the estimate says.

    Innovations are white, so the mean NIS of N readings has N dof / dof of freedom. The errors of one run hang
    together (its bias is one constant), so its mean NEES is held against what a single draw may be.

    Args:
        dofs: numbers that a reading of each sensor measures, by name.
        own_noise: the plant is the filter's own model; otherwise a NIS may be smaller.
    """
    from scipy.special import chdtri  # quantiles alone: scipy.stats takes a second to load

    texts, holds, tail = [], True, (1.0 - CONFIDENCE) / 2.0
    for name, sensor in summary.sensors.items():
        if sensor.nis_mean is None:
            continue
        dof = sensor.used * dofs[name]
        low, high = (float(chdtri(dof, p)) / sensor.used for p in (1.0 - tail, tail))
        low = low if own_noise else 0.0
        holds &= low <= sensor.nis_mean <= high
        texts.append(f"NIS of {name} {sensor.nis_mean:.3f} (limits {low:.3f} to {high:.3f})")
    if summary.nees_mean is None or not texts:
        return Check("consistent", False, "nothing was estimated that could be compared with truth")
    high = float(chdtri(summary.nees_dof, 1.0 - CONFIDENCE))
    holds &= summary.nees_mean <= high
    texts.append(f"NEES {summary.nees_mean:.2f} of {summary.nees_dof} (limit {high:.1f})")
    return Check("consistent", holds, ", ".join(texts))


def without_promise(check: Check) -> Check:
    """What is promised of honest sensors, where some were made to lie: measured, and not asked."""
    return Check(check.name, None, f"{check.text}; promised of honest sensors only")


def loss_check(end: Mapping[str, Any], status: Mapping[str, Any], *, lied: bool = False) -> Check:
    """Every reading that was sent was taken and used, none lost, refused, late or dropped.

    Args:
        end: the plant's last line: what it sent, and how long it paused for want of processor time.
        lied: its sensors had faults; what was sent must have been taken, but may have been rejected.
    """
    wrong, sent = [], end["sent"]
    for name, number in sent.items():
        sensor = status["sensors"][name]
        refused = sum(sensor["refused"].values())
        taken = sensor["used"] + (sensor["rejected"] if lied else 0)
        if taken != number or sensor["lost"] or refused:
            wrong.append(
                f"{name}: {number} sent, {sensor['used']} used, {sensor['rejected']} rejected, {sensor['late']} late, "
                f"{sensor['lost']} lost, {refused} unreadable"
            )
    dropped = status["queue"]["dropped"]
    if dropped:
        wrong.append(f"{dropped} dropped in the daemon's queue")
    if wrong:
        return Check("no loss", False, "; ".join(wrong))
    total = ", ".join(f"{number} {name}" for name, number in sent.items())
    became = "taken" if lied else "used"
    pause = f"; the plant paused {end['paused_s']:.2f} s, this machine was busy" if end["paused_s"] else ""
    return Check("no loss", True, f"every reading sent was {became}: {total}{pause}")


def without_trailing_ticks(chunks: Iterable[NDArray[Any]]) -> Iterator[NDArray[Any]]:
    """Events up to the last reading: when the plant has gone, its sensors fall silent, which is no fault of theirs."""
    held: list[NDArray[Any]] = []
    for chunk in chunks:
        readings = np.flatnonzero(chunk["sensor"] != TICK)
        end = int(readings[-1]) + 1 if len(readings) else 0
        if end:
            yield from held
            held.clear()
            yield chunk[:end]
        held.append(chunk[end:].copy())


def replay_check(recording: Path, events: int, summary: Summary) -> Check:
    """The daemon's recording, replayed, gives the reports the daemon made, bit for bit.

    Args:
        events: how many were replayed; the recording may hold ticks after them.
    """
    digest, reports = OutputDigest(), Reports(recording)
    while number := min(reports.available(), events - reports.count):
        digest.update(reports.take(number))
    if not reports.count:
        return Check("repeatable", False, "the daemon's recording holds no reports")
    same = digest.hexdigest() == summary.output_sha256
    text = f"{reports.count} reports of the live run and of its replay "
    return Check(
        "repeatable", same, text + ("have the same bits" if same else "differ (`fusiond diff` says where)")
    )
