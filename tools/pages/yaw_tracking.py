"""Seed 002's car steered by the daemon's law: it follows the yaw rate of a J-turn.

The car has tyres that saturate (`simulation.vehicle_drive`), the filter and the law think they are linear.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fusiond.engine.engine import Engine
from fusiond.simulation.streams import stream
from fusiond.simulation.tables import Reading
from fusiond.simulation.vehicle_drive import STEP_S, Tyres, wheel_forces_n
from fusiond.simulation.vehicle_equations import Car, advance
from fusiond.simulation.vehicle_manoeuvres import BEGIN_S, CORNERING_M_S2, RAMP_S
from tools.pages.trials import records

SAMPLE = 10
"""Milliseconds between two readings, and two commands."""
DURATION_S = 7.0
SETTLED_S = 1.0
"""After the end of the ramp, the turn is steady."""
NOISE = {"speed": (0.1,), "imu": (0.025, 0.002)}


@dataclass(frozen=True, slots=True)
class Turn:
    """One J-turn, a row each 10 ms: wanted and true yaw rate, rad/s, lateral velocity, m/s, steering, rad."""

    t_s: Any
    wanted: Any
    yaw_rate: Any
    vy: Any
    steering: Any

    @property
    def steady_rms(self) -> float:
        """Root mean square error of the yaw rate once the turn is steady, over the yaw rate wanted."""
        late = self.t_s > BEGIN_S + RAMP_S + SETTLED_S
        return float(np.sqrt(np.mean((self.yaw_rate - self.wanted)[late] ** 2)) / self.wanted[-1])

    @property
    def largest(self) -> float:
        """Largest error, over the yaw rate wanted at the end."""
        return float(np.abs(self.yaw_rate - self.wanted).max() / self.wanted[-1])


def wanted_at(t_s: float, speed_m_s: float) -> float:
    """Yaw rate of the J-turn: a ramp of half a second to what corners at 4 m/s^2."""
    return CORNERING_M_S2 / speed_m_s * min(max((t_s - BEGIN_S) / RAMP_S, 0.0), 1.0)


def turn(engine: Engine, speed_km_h: float, seed: int = 0) -> Turn:
    """Drive one J-turn."""
    engine.reset()
    rng, car, tyres = stream(seed, "yaw_tracking"), Car(), Tyres()
    speed = speed_km_h / 3.6
    state, after = np.zeros((1, 10)), np.zeros((1, 10))
    state[0, 0] = speed
    steering = 0.0
    rows: list[tuple[float, ...]] = []
    felt: list[float] = []
    for step in range(round(DURATION_S / STEP_S) + 1):
        if step % SAMPLE == 0:
            t_ns = step * 1_000_000
            measured = {"speed": (state[0, 0],), "imu": (float(np.mean(felt or [0.0])), state[0, 2])}
            noisy = [
                Reading(t_ns, name, tuple(np.add(z, NOISE[name] * rng.standard_normal(len(z))).tolist()))
                for name, z in measured.items()
            ]
            goal = Reading(t_ns, "reference", (wanted_at(step * STEP_S, speed),))
            for one in records(engine.layout, [goal, *noisy]):
                report = engine.process(one.reshape(1))[0]
                if report["command_due"]:
                    steering = float(report["command"][0])
            rows.append((step * STEP_S, goal.z[0], state[0, 2], state[0, 1], steering))
            felt = []
        body = (float(state[0, 0]), float(state[0, 1]), float(state[0, 2]))
        state[0, 3:5] = tyres.axles_n(car, body, steering)
        drive = np.array([wheel_forces_n(car, speed - body[0])])
        pushed = car.push(drive, state[:, 3:5], np.array([steering]), state[:, :2])
        felt.append(float(pushed[0, 1]))
        advance(state, after, pushed, STEP_S)
        state, after = after, state
    return Turn(*np.array(rows).T)
