"""Signatures: how an error of unit size in one sensor would by now have spread through the running filter.

A fault f of a sensor reaches the innovation as f - H eps, where eps is the error it has caused so far; the update
turns that into eps + K (f - H eps), the prediction into F eps (and F eps + B g for an input that is wrong by g). Every
cell of the bank carries the eps of a unit fault that began when the cell last started anew, so the likelihood ratio it
accumulates is the exact one for that fault, in transients, on time-varying and on linearised systems alike.

A cell of a scale errs by h, one of a delay by minus its rate of change, in all channels at once.

The alarm is raised with the reading that proves it, be it the first; whether one bad sample did it the judge asks.

Source: Willsky & Jones 1976, with the onset left to the restarts of a CUSUM (Page 1954).
"""

from __future__ import annotations

from typing import Any

from fusiond.engine.records import CENTRAL
from fusiond.numerics.kernel import kernel
from fusiond.types import Alarm, Kind

from .sizes import CELLS, ERRORS, INPUTS, SENSORS

CELL = int(Alarm.CELL)
SCALE, DELAY = int(Kind.SCALE), int(Kind.DELAY)


@kernel
def carry(track: Any, work: Any, row: int, F: Any, B: Any) -> None:
    """Add one interval to what has passed since the last entry: carried <- F carried, plus B for the inputs."""
    if row != CENTRAL:
        return
    carried, moved = track.monitor.carried, work.carried
    for i in range(ERRORS):
        for j in range(ERRORS + INPUTS):
            moved[i, j] = 0.0
        for k in range(ERRORS):
            f = F[i, k]
            if f != 0.0:
                for j in range(ERRORS + INPUTS):
                    moved[i, j] += f * carried[k, j]
        for j in range(INPUTS):
            moved[i, ERRORS + j] += B[i, j]
    for i in range(ERRORS):
        for j in range(ERRORS + INPUTS):
            carried[i, j] = moved[i, j]


@kernel
def forget_interval(track: Any) -> None:
    """Nothing has passed since the last entry."""
    carried = track.monitor.carried
    for i in range(ERRORS):
        for j in range(ERRORS + INPUTS):
            carried[i, j] = 1.0 if i == j else 0.0


@kernel
def move_signatures(track: Any, design: Any, work: Any) -> None:
    """Bring every cell's signature from the last entry to this reading's time."""
    monitor, tests = track.monitor, design.tests
    for i in range(ERRORS):
        for c in range(CELLS):
            work.phi[i, c] = 0.0
        for k in range(ERRORS):
            t = monitor.carried[i, k]
            if t != 0.0:
                for c in range(CELLS):
                    work.phi[i, c] += t * monitor.phi[k, c]
        for sensor in range(SENSORS):
            if tests.is_input[sensor]:
                for c in range(tests.first[sensor], tests.last[sensor]):
                    work.phi[i, c] += monitor.carried[i, ERRORS + tests.channel[c]]
    for i in range(ERRORS):
        for c in range(CELLS):
            monitor.phi[i, c] = work.phi[i, c]


@kernel
def weigh(track: Any, design: Any, work: Any, sensor: int, channel: int) -> None:
    """Accumulate one scalar innovation's evidence in every cell, and let the update carry the signatures on."""
    monitor, tests = track.monitor, design.tests
    rho = work.rho
    for c in range(CELLS):
        rho[c] = 0.0
    scale, delay = 0.0, 0.0
    for i in range(design.dof[sensor]):
        scale += work.D[channel, i] * work.h[i]
        delay -= work.D[channel, i] * work.hdot[i]
    for c in range(tests.first[sensor], tests.last[sensor]):
        if tests.kind[c] == SCALE:
            rho[c] = scale
        elif tests.kind[c] == DELAY:
            rho[c] = delay
        else:
            rho[c] = work.D[channel, tests.channel[c]]
    for k in range(ERRORS):
        h = work.H[channel, k]
        if h != 0.0:
            for c in range(CELLS):
                rho[c] -= h * monitor.phi[k, c]
    inverse = 1.0 / work.root[channel] if work.root[channel] > 0.0 else 0.0
    e, band = work.tested[channel], tests.dead_band[sensor]
    for c in range(CELLS):
        shift = tests.theta[c] * rho[c] * inverse
        # against a mean that is no fault (dead band, or tolerated error): only what lies beyond it is evidence
        still = max(band, tests.tolerance[c] * abs(rho[c]) * inverse)
        edge = still if shift > 0.0 else -still
        slope = shift - edge if abs(shift) > still else 0.0
        work.gain[c] += slope * (e - 0.5 * (shift + edge))
    for k in range(ERRORS):
        gain = work.K[channel, k]
        if gain != 0.0:
            for c in range(CELLS):
                monitor.phi[k, c] += gain * rho[c]


@kernel
def raise_alarm(track: Any, design: Any) -> bool:
    """Raise the alarm of the first cell over its limit; whether there is one."""
    monitor, tests = track.monitor, design.tests
    over = False
    for sensor in range(SENSORS):
        for c in range(tests.first[sensor], tests.last[sensor]):
            if monitor.llr[c] >= tests.limit[c]:
                over = True
                if monitor.alarm == 0:
                    monitor.alarm, monitor.alarm_sensor, monitor.alarm_cell = CELL, sensor, c
    return over


@kernel
def restart_cells(track: Any, design: Any, sensor: int) -> None:
    """Count the reading, raise the alarm, start anew the cells without or with stale evidence.

    With an alarm all of them start anew: what one of them takes for its fault its neighbours and its twins would take
    for theirs a few readings later. So one excursion of the noise is one false alarm, as the thresholds reckon.
    """
    monitor, tests = track.monitor, design.tests
    over = raise_alarm(track, design)
    for other in range(SENSORS):
        counts = other == sensor or tests.is_input[other]
        for c in range(tests.first[other], tests.last[other]):
            if counts:
                monitor.count[c] += 1
            if over or monitor.llr[c] <= 0.0 or monitor.count[c] > tests.age[c]:
                monitor.llr[c] = 0.0
                monitor.count[c] = 0
                for k in range(ERRORS):
                    monitor.phi[k, c] = 0.0


@kernel
def bank(track: Any, design: Any, work: Any, sensor: int, dof: int) -> None:
    """One reading through all cells."""
    monitor = track.monitor
    move_signatures(track, design, work)
    for c in range(CELLS):
        work.gain[c] = 0.0
    for channel in range(dof):
        weigh(track, design, work, sensor, channel)
    for c in range(CELLS):
        monitor.llr[c] += work.gain[c]
    restart_cells(track, design, sensor)
