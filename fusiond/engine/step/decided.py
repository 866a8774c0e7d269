"""What has been decided about a sensor, done to its readings: left out, or used with the known error taken off."""

from __future__ import annotations

from typing import Any

from fusiond.numerics.kernel import kernel


@kernel
def is_excluded(track: Any, sensor: int, t_ns: int) -> bool:
    """Whether the sensor's readings of that time are not used."""
    reaction = track.reaction
    out = reaction.excluded[sensor] and t_ns >= reaction.out_from_ns[sensor]
    return bool(out and (reaction.until_ns[sensor] == 0 or t_ns < reaction.until_ns[sensor]))


@kernel
def in_force(reaction: Any, sensor: int, k: int, t_ns: int) -> bool:
    """Whether the sensor's correction k, the one before or the last, holds at that time."""
    begins, ends = reaction.from_ns[sensor, k], reaction.to_ns[sensor, k]
    return bool(begins != 0 and begins <= t_ns and (ends == 0 or t_ns < ends))


@kernel
def corrected(track: Any, design: Any, reading: Any, spare: Any) -> Any:
    """The reading with what is known of its sensor's error taken off: (z - offset - drift (t - from)) / gain."""
    reaction, sensor = track.reaction, reading.sensor
    for k in range(2):
        if in_force(reaction, sensor, k, reading.t_ns):
            spare[0] = reading
            since_s = (reading.t_ns - reaction.from_ns[sensor, k]) * 1e-9
            for i in range(design.length[sensor]):
                error = reaction.offset[sensor, k, i] + reaction.drift[sensor, k, i] * since_s
                spare[0].z[i] = (reading.z[i] - error) / (1.0 + reaction.gain_error[sensor, k, i])
            return spare[0]
    return reading


@kernel
def undelay(track: Any, design: Any, work: Any, reading: Any) -> None:
    """Add to work.nu by how much the reading has moved between its measurement and its stamp: rate of h times delay."""
    reaction, sensor = track.reaction, reading.sensor
    for k in range(2):
        if in_force(reaction, sensor, k, reading.t_ns):
            for i in range(design.dof[sensor]):
                work.nu[i] += work.hdot[i] * reaction.lag[sensor, k, i]
            return
