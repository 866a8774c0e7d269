"""Seed 000: mini car and bi-rotor under a PD law, with four sources of feedback; the filter is the engine.

The law is the engine's own (`control/pd.py`), its command the only force. The feedback without a filter comes from
`simulation.closed_loop`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_discrete_are

from fusiond.assembly.assembly import Assembly
from fusiond.simulation import closed_loop, rig
from fusiond.simulation.closed_loop import LoopRun, PdLaw
from fusiond.simulation.rig import PointRig
from fusiond.simulation.systems import FEEDBACKS
from fusiond.types import NANOSECONDS
from tools.pages.trials import Floats, Steered, configured, steer

DURATION_NS = 30 * NANOSECONDS
LAST_S = 10.0
BIAS_M_S2 = -0.97
SAMPLE_S = 1e-3
PERIOD = 30
"""Samples between two ultrasonic readings."""
OFFSETS_M = {1e-8: 1.545, 1e-6: 0.374, 1e-5: 0.197, 1e-4: 0.107, 1e-3: 0.061}
"""Steady offset without a bias state by Q22 a sample, from a reproduction that feeds back after the correction."""


@dataclass(frozen=True, slots=True)
class Example:
    """One of the seed's two systems."""

    name: str
    rig: Callable[..., PointRig]
    goal_m: float

    def law(self, plant: PointRig) -> PdLaw:
        """The seed's PD law, for the loops without a filter."""
        return PdLaw(self.goal_m, plant.plant.weight_n)


EXAMPLES = (Example("minicar", rig.minicar, 2.0), Example("birotor", rig.birotor, 0.75))


def unfused(example: Example, scenario: str, seed: int = 0) -> LoopRun:
    """The loop closed without a filter: scenario `ideal`, `accelerometer` or `ultrasonic`."""
    plant = example.rig(seed)
    feedback = FEEDBACKS[scenario](plant.plant.start)
    return closed_loop.run(plant, example.law(plant), feedback, DURATION_NS)


def fused(example: Example, seed: int = 0) -> Steered:
    """The loop closed by the engine with the shipped configuration."""
    return steer(configured(example.name).engine(), example.rig(seed), DURATION_NS)


def without_bias_state(Q22: float) -> Assembly:
    """The mini car's configuration with the seed's own two states, and Q = diag(0, Q22) a sample."""
    changes = {
        "model": {
            "bias": False,
            "velocity_noise_m_s_sqrt_s": (Q22 / SAMPLE_S) ** 0.5,
            "bias_noise_m_s2_sqrt_s": None,
        },
        "sensor": {"accelerometer": {"noise_std": {"acceleration_m_s2": 0.0}}},
        "initial": {"state": {"acceleration_bias_m_s2": None}, "std": {"acceleration_bias_m_s2": None}},
        "control": {"rate_hz": 1.0 / SAMPLE_S},
    }
    return configured("minicar", changes)


def offset_m(Q22: float, seed: int = 0) -> float:
    """Mean distance past the goal over the last 10 s without a bias state, the bias at its mean of -0.97 m/s^2."""
    run = steer(without_bias_state(Q22).engine(), rig.minicar(seed, bias_var=0.0), DURATION_NS).loop
    late = run.t_ns >= run.t_ns[-1] - int(LAST_S * NANOSECONDS)
    return float(np.mean(run.states[late, 0]) - EXAMPLES[0].goal_m)


def predicted_offset_m(Q22: float, *, before_correction: bool = True) -> float:
    """The same from the steady gain: x - x_d = -e_p - (Kv/Kp) e_v, averaged over the samples of one period.

    e after a correction solves e = (I - K H)(A e + B b) over one period of 30 samples. The engine commands when the
    accelerometer speaks, before a correction of the same stamp: the samples 1 to 30 after one, otherwise 0 to 29.
    """
    A, B = np.array([[1.0, SAMPLE_S], [0.0, 1.0]]), np.array([SAMPLE_S**2 / 2.0, SAMPLE_S])
    powers = [np.linalg.matrix_power(A, k) for k in range(PERIOD)]
    A_period = A @ powers[-1]
    Q = np.array(sum(F @ np.diag([0.0, Q22]) @ F.T for F in powers))
    pushed: Floats = np.array(sum(F @ B for F in powers)) * BIAS_M_S2
    H = np.array([[1.0, 0.0]])
    P = solve_discrete_are(A_period.T, H.T, Q, np.array([[1e-4]]))
    reduced = np.eye(2) - P @ H.T @ H / (P[0, 0] + 1e-4)
    e = np.linalg.solve(np.eye(2) - reduced @ A_period, reduced @ pushed)
    sum_of_errors = 0.0
    for _ in range(PERIOD):
        e_next = A @ e + B * BIAS_M_S2
        sum_of_errors += float(np.sum(e_next if before_correction else e))
        e = e_next
    return -sum_of_errors / PERIOD
