"""The command: when it is due, at which level, what the law wants, and what of that may go out.

Times of commands lie on a regular grid. What the controller remembers stands in the desk, which is never rolled back: a
command that went out is history, whatever a late reading teaches. `assembly` copies this file over `steer.py`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fusiond.control.levels import SAFE, level_of, safe_command
from fusiond.control.saturation import left_of_fade, limited, slewed
from fusiond.numerics.arrays import copy_vector
from fusiond.numerics.kernel import kernel
from fusiond.types import Health, Kind, Role

from .law import command, cost
from .sizes import ADAPTS, CONTROLS, ERRORS, SENSORS

UPDATE = int(Role.UPDATE)
HEALTHY = int(Health.HEALTHY)
FAULTY = int(Health.FAULTY)
EXCLUDED = int(Health.EXCLUDED)
PROBATION = int(Health.PROBATION)
SILENT = int(Health.SILENT)
NOISE = int(Kind.NOISE)


@kernel
def works(report: Any, sensor: int) -> bool:
    """Whether the estimate makes use of the sensor."""
    health = report.health[sensor]
    return bool(health != SILENT and health != EXCLUDED and health != PROBATION)


@kernel
def awaits(track: Any, desk: Any, design: Any, report: Any) -> bool:
    """Whether a sensor that the command waits for has yet to speak; one that missed its last turn is not waited for."""
    due_ns = desk.command_due_ns
    for sensor in range(SENSORS):
        spoke_ns = track.sensor_t_ns[sensor]
        late = due_ns - design.control_period_ns <= spoke_ns and (
            spoke_ns < due_ns or track.sensor_seen[sensor] == 0
        )
        if design.awaited[sensor] and late and works(report, sensor):
            return True
    return False


@kernel
def is_due(track: Any, desk: Any, design: Any, now_ns: int, report: Any) -> bool:
    """Whether to command now; the next command is then due at the grid's first time after now."""
    if not desk.command_started:
        desk.command_due_ns = now_ns
        desk.command_started = 1
    if now_ns < desk.command_due_ns:
        return False
    if now_ns < desk.command_due_ns + design.command_wait_ns and awaits(track, desk, design, report):
        return False
    desk.command_periods = (now_ns - desk.command_due_ns) // design.control_period_ns + 1
    desk.command_due_ns += desk.command_periods * design.control_period_ns
    return True


@kernel
def trusts(design: Any, report: Any) -> bool:
    """Whether no deviation is larger than the law may be fed."""
    for i in range(ERRORS):
        if report["std"][i] > design.largest_std[i]:
            return False
    return True


@kernel
def is_sound(design: Any, report: Any, sensor: int) -> bool:
    """Whether the sensor corrects the state and is beyond doubt: where noise is estimated, more of it is no lie."""
    health = report.health[sensor]
    noisy = ADAPTS > 0 and health == FAULTY and report.fault[sensor] == NOISE
    return bool(design.role[sensor] == UPDATE and (health == HEALTHY or noisy))


@kernel
def doubts(desk: Any, design: Any, now_ns: int, report: Any) -> bool:
    """Whether for too long no sensor that is beyond doubt has been correcting the state."""
    sound = False
    for sensor in range(SENSORS):
        sound = sound or is_sound(design, report, sensor)
    if sound:
        desk.doubt_since_ns = 0
        return False
    if desk.doubt_since_ns == 0:
        desk.doubt_since_ns = now_ns
    return bool(now_ns - desk.doubt_since_ns > design.doubt_ns)


@kernel
def note_done(desk: Any, design: Any, now_ns: int) -> None:
    """What the last command became: as sent, or as the actuator has acknowledged since."""
    told = design.queue == 0 and desk.has_applied and desk.applied_t_ns >= desk.command_t_ns
    for i in range(CONTROLS):
        desk.done[i] = desk.applied[i] if told and desk.applied_t_ns <= now_ns else desk.command[i]


@kernel
def source_of(track: Any, report: Any) -> int:
    """What the estimate is made of: a number that changes when a sensor comes or goes, or the state is reset."""
    source = track.resets
    for sensor in range(SENSORS):
        source = 2 * source + (1 if works(report, sensor) else 0)
    return int(source)


@kernel
def want(track: Any, desk: Any, design: Any, now_ns: int, report: Any) -> bool:
    """Ask the law, and take off the bump that a switch of the estimate makes; False where an answer is not finite."""
    note_done(desk, design, now_ns)
    command(report.x, desk, design.law_at, design.c, desk.wanted)
    source = source_of(track, report)
    switched = desk.command_given and (source != desk.source or desk.safe_since_ns != 0)
    desk.source = source
    finite = True
    for i in range(CONTROLS):
        if switched and design.fade_ns > 0:
            desk.bump[i] = desk.command[i] - desk.wanted[i]
            desk.bump_ns = now_ns
        finite = finite and np.isfinite(desk.wanted[i])
    return finite


@kernel
def allow(desk: Any, design: Any, now_ns: int) -> None:
    """Write what of the wanted command goes out: faded, within limits, no faster than the actuator may move."""
    left = left_of_fade(now_ns - desk.bump_ns, design.fade_ns) if desk.command_given else 0.0
    passed_s = (now_ns - desk.command_t_ns) * 1e-9
    for i in range(CONTROLS):
        u = desk.wanted[i] + left * desk.bump[i] if left > 0.0 else desk.wanted[i]
        u = limited(u, design.lowest[i], design.highest[i])
        if desk.command_given and design.slew[i] < np.inf:
            u = slewed(u, desk.command[i], design.slew[i] * max(passed_s, 0.0))
        desk.command[i] = u


@kernel
def retreat(desk: Any, design: Any, now_ns: int) -> None:
    """Write the safe command."""
    if desk.safe_since_ns == 0:
        desk.safe_since_ns = now_ns
        copy_vector(desk.command, desk.safe_from)
    since_ns = now_ns - desk.safe_since_ns
    for i in range(CONTROLS):
        last, begun, safe = desk.command[i], desk.safe_from[i], design.safe_command[i]
        desk.command[i] = safe_command(design.safe_mode, last, begun, safe, since_ns, design.safe_ramp_ns)


@kernel
def enqueue(desk: Any, design: Any) -> None:
    """Queue the command; desk.acting is what acts now. For periods that were skipped the command before acted on."""
    last = design.queue - 1
    if last < 0:
        copy_vector(desk.command, desk.acting)
        return
    turns = min(desk.command_periods - 1, design.queue) + 1
    for turn in range(turns):
        copy_vector(desk.queue[0], desk.acting)
        for place in range(last):
            copy_vector(desk.queue[place + 1], desk.queue[place])
        copy_vector(desk.command if turn == turns - 1 else desk.sent, desk.queue[last])


@kernel
def account(desk: Any, design: Any, report: Any) -> None:
    """Mean cost of the commands, of the estimate alone: the first ones evenly, then forgotten by and by."""
    desk.cost_count += 1
    share = max(1.0 / desk.cost_count, design.cost_share)
    desk.cost += share * (cost(report.x, desk, design.law_at, design.c) - desk.cost)


@kernel
def steer(track: Any, desk: Any, design: Any, now_ns: int, report: Any) -> None:
    """Compute a command when one is due, from the state in the report."""
    if not is_due(track, desk, design, now_ns, report):
        return
    report.command_due = 1
    copy_vector(desk.command, desk.sent)
    reckoned_ns = now_ns - track.update_ns - design.dead_reckoning_ns
    trusted = trusts(design, report) and not doubts(desk, design, now_ns, report)
    level = level_of(report.service, desk.has_reference != 0, trusted, reckoned_ns, design.reckoning_ns)
    if level != SAFE and want(track, desk, design, now_ns, report):
        allow(desk, design, now_ns)
        account(desk, design, report)
        desk.safe_since_ns = 0
        desk.command_given = 1
        report.command_valid = 1
    else:
        retreat(desk, design, now_ns)
    enqueue(desk, design)
    desk.command_t_ns = now_ns
    copy_vector(desk.command, report.command)
