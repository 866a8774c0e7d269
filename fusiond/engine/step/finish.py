"""The end of a step: the state, the health of everything by the age of its data, and the command."""

from __future__ import annotations

from typing import Any

import numpy as np

from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import ud_variance
from fusiond.types import Health, Kind, ServiceHealth

from .guard import unobserved_states
from .silence import is_silent, silent_since, unsteady, was_silent
from .sizes import CONTROLS, ERRORS, SENSORS, STATES
from .steer import steer

HEALTHY = int(Health.HEALTHY)
SILENT = int(Health.SILENT)
SILENCE = int(Kind.SILENT)
NOMINAL = int(ServiceHealth.NOMINAL)
DEGRADED = int(ServiceHealth.DEGRADED)
DEAD_RECKONING = int(ServiceHealth.DEAD_RECKONING)
INVALID = int(ServiceHealth.INVALID)

PATIENCE = 1.5
"""A reading may come this much later, in times of its sensor's lateness, than its like have come."""


@kernel
def describe_state(track: Any, report: Any) -> bool:
    """Write x and std of the centralized filter; False where they are not finite."""
    finite = True
    for i in range(STATES):
        report.x[i] = track.x[0, i]
        finite = finite and np.isfinite(report.x[i])
    for i in range(ERRORS):
        report["std"][i] = np.sqrt(ud_variance(track.U[0], track.d[0], i))
        finite = finite and np.isfinite(report["std"][i])
    report.state_t_ns = track.filter_t_ns[0]
    return finite


@kernel
def describe_resets(track: Any, report: Any) -> None:
    """Write resets and jump."""
    report.resets = track.resets
    for i in range(ERRORS):
        report.jump[i] = track.jump[i]


@kernel
def judge_health(track: Any, desk: Any, design: Any, now_ns: int, finite: bool, report: Any) -> None:
    """Write report.health and report.service: silence by the age of data at now_ns, faults as judged.

    A sensor whose readings come late is given that time: what it says now it may have measured when it seemed silent.
    """
    sound = True
    for sensor in range(SENSORS):
        heard_ns = now_ns - int(PATIENCE * desk.lateness_ns[sensor])
        broken = unsteady(track, design, sensor, now_ns) and was_silent(track, design, sensor, heard_ns)
        quiet = broken or is_silent(track, design, sensor, heard_ns)
        quiet = quiet and track.started != 0
        report.health[sensor] = SILENT if quiet else track.reaction.health[sensor]
        sound = sound and report.health[sensor] == HEALTHY
    age_ns = now_ns - track.update_ns
    if not (track.started and finite) or age_ns > design.invalid_ns:
        report.service = INVALID
    elif age_ns > design.dead_reckoning_ns:
        report.service = DEAD_RECKONING
    else:
        report.service = NOMINAL if sound else DEGRADED


@kernel
def describe_faults(track: Any, design: Any, report: Any) -> None:
    """Write what is known to be wrong with every sensor, silence included."""
    reaction = track.reaction
    report.model = reaction.model
    for sensor in range(SENSORS):
        silent = report.health[sensor] == SILENT
        report.fault[sensor] = SILENCE if silent else reaction.kind[sensor]
        report.fault_channel[sensor] = -1 if silent else reaction.channel[sensor]
        report.fault_size[sensor] = 0.0 if silent else reaction["size"][sensor]
        report.fault_std[sensor] = 0.0 if silent else reaction.size_std[sensor]
        report.fault_onset_ns[sensor] = (
            silent_since(track, design, sensor) if silent else reaction.onset_ns[sensor]
        )
        report.suspects[sensor] = 0 if silent else reaction.suspects[sensor]


@kernel
def finish(track: Any, desk: Any, design: Any, now_ns: int, report: Any) -> None:
    """Complete the report of one reading or tick."""
    finite = describe_state(track, report)
    describe_resets(track, report)
    report.unobserved = unobserved_states(track, design, now_ns) if track.started else 0
    judge_health(track, desk, design, now_ns, finite, report)
    describe_faults(track, design, report)
    if CONTROLS > 0 and track.started:
        steer(track, desk, design, now_ns, report)
