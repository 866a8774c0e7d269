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
def corrected(track: Any, design: Any, reading: Any, spare: Any) -> Any:
    """The reading with what is known of its sensor's error taken off: (z - offset - drift (t - from)) / gain."""
    reaction, sensor = track.reaction, reading.sensor
    for k in range(2):
        begins, ends = reaction.from_ns[sensor, k], reaction.to_ns[sensor, k]
        if begins != 0 and begins <= reading.t_ns and (ends == 0 or reading.t_ns < ends):
            spare[0] = reading
            since_s = (reading.t_ns - begins) * 1e-9
            for i in range(design.length[sensor]):
                error = reaction.offset[sensor, k, i] + reaction.drift[sensor, k, i] * since_s
                spare[0].z[i] = (reading.z[i] - error) / (1.0 + reaction.gain_error[sensor, k, i])
            return spare[0]
    return reading
