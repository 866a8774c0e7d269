"""Seed 003's robot: two driven wheels, once round the square (0,0), (0,3), (3,3), (3,0), (0,0), in metres.

It is led along the square exactly, so the truth is the square itself and whatever errs are the sensors: unequal wheels,
a track that is not the nominal one, wheels that spin when they push and brake, turns in which they scrub. The seed
gives none of these sizes, only what its fused estimate made of them: 23.5 cm (X) and 32 cm (Y) off at the end. They are
chosen so that the filter of configs/square_robot.toml ends that far off (root mean square over runs): X is wrong by the
heading errors of corners 1 and 2, Y by those of corners 2 and 3, so the third corner's floor is the slippery one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fusiond.simulation.streams import stream
from fusiond.simulation.tables import Floats, Reading, Times, Truth, stamps
from fusiond.types import NANOSECONDS

STEP_NS = 1_000_000
SAMPLE_NS = 10_000_000
SAMPLED = slice(None, None, SAMPLE_NS // STEP_NS)
SIDE_M = 3.0
CORNERS = 3
PHASES = 22
"""Of which the first is rest, then three of a side and three of a turn, again and again; after the last it stands."""


class Phase(NamedTuple):
    """A stretch of constant acceleration."""

    duration_s: float
    acceleration_m_s2: float = 0.0
    yaw_acceleration_rad_s2: float = 0.0


@dataclass(frozen=True, slots=True)
class Pace:
    """How it goes: at rest, then four sides from standstill to standstill, with a turn to the right between two."""

    rest_s: float = 5.0
    speed_m_s: float = 1.0
    acceleration_m_s2: float = 2.0
    turn_s: float = 0.77
    turn_ramp_s: float = 0.25

    @property
    def end_s(self) -> float:
        """When it is back at its start."""
        return sum(phase.duration_s for phase in self.phases())

    def phases(self) -> list[Phase]:
        """Everything it does until it is back."""
        ramp_s = self.speed_m_s / self.acceleration_m_s2
        peak_rad_s = -0.5 * math.pi / (self.turn_s - self.turn_ramp_s)
        side = [
            Phase(ramp_s, self.acceleration_m_s2),
            Phase(SIDE_M / self.speed_m_s - ramp_s),
            Phase(ramp_s, -self.acceleration_m_s2),
        ]
        turn = [
            Phase(self.turn_ramp_s, 0.0, peak_rad_s / self.turn_ramp_s),
            Phase(self.turn_s - 2.0 * self.turn_ramp_s),
            Phase(self.turn_ramp_s, 0.0, -peak_rad_s / self.turn_ramp_s),
        ]
        return [Phase(self.rest_s), *(side + turn) * CORNERS, *side]


@dataclass(frozen=True, slots=True)
class Motion:
    """What happens, a row a millisecond, all (k,): phase is the number of the stretch that is going on."""

    t_ns: Times
    x_m: Floats
    y_m: Floats
    yaw_rad: Floats
    speed_m_s: Floats
    yaw_rate_rad_s: Floats
    acceleration_m_s2: Floats
    phase: Times


def motion(pace: Pace, duration_ns: int) -> Motion:
    """The square, integrated exactly: accelerations are constant over every millisecond."""
    t_ns = stamps(duration_ns, STEP_NS)
    dt_s, k = STEP_NS / NANOSECONDS, t_ns.size
    phases = pace.phases()
    counts = [round(phase.duration_s / dt_s) for phase in phases]
    phase = np.repeat(np.arange(len(phases) + 1), [*counts, max(0, k - sum(counts))])[: k - 1]
    a, alpha = (np.array([*(row[i] for row in phases), 0.0])[phase] for i in (1, 2))
    speed = np.append(0.0, np.cumsum(a) * dt_s)
    rate = np.append(0.0, np.cumsum(alpha) * dt_s)
    yaw = 0.5 * math.pi + np.append(0.0, np.cumsum((rate[:-1] + 0.5 * dt_s * alpha) * dt_s))
    # it turns on the spot: over a step with any way in it the heading is constant
    way = (speed[:-1] + 0.5 * dt_s * a) * dt_s
    x = np.append(0.0, np.cumsum(way * np.cos(yaw[:-1])))
    y = np.append(0.0, np.cumsum(way * np.sin(yaw[:-1])))
    return Motion(t_ns, x, y, yaw, speed, rate, np.append(0.0, a), np.append(0, phase))


@dataclass(frozen=True, slots=True)
class Errors:
    """Standard deviations of what errs; each is drawn once a run, a slip anew for every stretch in which it happens.

    wheel_mismatch: right over left wheel size, less 1.   track: 1 less nominal over true.   turn_slip: the
    share of a turn of the wheels that scrubs and does not turn the body, at corners 1, 2, 3.   push_slip_s: the wheels
    run ahead of the body by |this| times its acceleration, and lag behind by as much when they brake.
    """

    wheel_mismatch: float = 0.00015
    track: float = 0.01
    turn_slip: tuple[float, float, float] = (0.0322, 0.0322, 0.0562)
    push_slip_s: float = 0.1
    acceleration_bias_m_s2: float = 0.005


@dataclass(frozen=True, slots=True)
class Sensors:
    """Encoders, accelerometer and gyro: white noise of every reading, 100 a second.

    The gyro has 0.005 rad/s/sqrt(Hz) and a bias of 0.01 rad/s, as asked; the rest is assumed.
    """

    track_m: float = 0.4
    encoder_std_m_s: float = 0.002
    accelerometer_std_m_s2: float = 0.01
    gyro_std_rad_s: float = 0.05
    gyro_bias_rad_s: float = 0.01

    def std(self, name: str) -> tuple[float, ...]:
        """Standard deviation of each channel of one of them."""
        return {
            "encoders": (self.encoder_std_m_s, self.encoder_std_m_s),
            "accelerometer": (self.accelerometer_std_m_s2,),
            "gyro": (self.gyro_std_rad_s,),
        }[name]


def run(
    seed: int, duration_ns: int, pace: Pace | None = None, errors: Errors | None = None,
    sensors: Sensors | None = None,
) -> tuple[list[Reading], Truth]:  # fmt: skip
    """Drive once round, then stand: the readings of all three sensors, and the truth every 10 ms.

    An accelerometer's reading is the mean over the 10 ms that end at its stamp; encoders and gyro tell the moment.
    """
    errors, sensors = errors or Errors(), sensors or Sensors()
    driven = motion(pace or Pace(), duration_ns)
    wrong = _wrong(seed, driven, errors)
    left, right = _wheels(driven, wrong, sensors)
    gained = np.diff(driven.speed_m_s[SAMPLED], prepend=0.0) * (NANOSECONDS / SAMPLE_NS)
    exact = {
        "encoders": np.column_stack((left, right))[SAMPLED],
        "accelerometer": (gained + wrong["acceleration_bias"][SAMPLED])[:, None],
        "gyro": (driven.yaw_rate_rad_s + sensors.gyro_bias_rad_s)[SAMPLED, None],
    }
    readings: list[Reading] = []
    for name, values in exact.items():
        noise = np.array(sensors.std(name)) * stream(seed, f"sensor/{name}").standard_normal(values.shape)
        readings.extend(
            Reading(t, name, tuple(z))
            for t, z in zip(driven.t_ns[SAMPLED].tolist(), (values + noise).tolist(), strict=True)
        )
    return readings, _truth(driven, wrong, sensors)


def _wrong(seed: int, driven: Motion, errors: Errors) -> dict[str, Floats]:
    """(k,) of every error over time, named after the states that a filter may have for it."""
    rng = stream(seed, "robot")
    mismatch, track, bias = rng.standard_normal(3) * (
        errors.wheel_mismatch, errors.track, errors.acceleration_bias_m_s2
    )  # fmt: skip
    corners = rng.standard_normal(CORNERS) * errors.turn_slip
    slips = np.abs(rng.standard_normal(PHASES + 1)) * errors.push_slip_s
    ones = np.ones(driven.t_ns.size)
    lap, within = np.divmod(driven.phase - 1, 6)
    turning = (driven.phase > 0) & (within >= 3) & (lap < CORNERS)
    return {
        "acceleration_bias": bias * ones,
        "push_slip": slips[driven.phase],
        "wheel_mismatch": mismatch * ones,
        "track_error": track * ones,
        "turn_slip": np.where(turning, corners[np.clip(lap, 0, CORNERS - 1)], 0.0),
    }


def _wheels(driven: Motion, wrong: dict[str, Floats], sensors: Sensors) -> tuple[Floats, Floats]:
    """(k,) speeds of the left and the right wheel as their nominal sizes say."""
    along = driven.speed_m_s + wrong["push_slip"] * driven.acceleration_m_s2
    lever_m = 0.5 * sensors.track_m / (1.0 - wrong["track_error"] - wrong["turn_slip"])
    left = (along - lever_m * driven.yaw_rate_rad_s) * (1.0 - 0.5 * wrong["wheel_mismatch"])
    right = (along + lever_m * driven.yaw_rate_rad_s) * (1.0 + 0.5 * wrong["wheel_mismatch"])
    return left, right


def _truth(driven: Motion, wrong: dict[str, Floats], sensors: Sensors) -> Truth:
    """What is true at any time, named after states and outputs; slips are only while something pushes or turns."""
    columns = {
        "x": driven.x_m, "y": driven.y_m, "yaw": driven.yaw_rad, "speed": driven.speed_m_s,
        "yaw_rate": driven.yaw_rate_rad_s, **wrong, "gyro_bias": np.full(driven.t_ns.size, sensors.gyro_bias_rad_s),
    }  # fmt: skip
    del columns["push_slip"], columns["turn_slip"]
    return Truth(driven.t_ns[SAMPLED], tuple(columns), np.column_stack(list(columns.values()))[SAMPLED])
