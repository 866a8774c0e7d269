"""What LQG control costs on average, known before it runs.

    J* = tr(S W) + tr(K' (R + B' S B) K P)

S, K: of the regulator, queue and integrals among its states.   W: process noise of one period.   P: covariance of the
error of the estimate that the command is computed from; 0 for states of the controller itself. The first term is what a
regulator that knows the state pays, the second what not knowing it costs. With commands that are late the first term
grows with S, and P stays that of the estimate now: the queue is known.

It holds whenever the error does not depend on what the process noise will do next, so for every set of working sensors
with its own P and the same K (separation), and for an estimator that is not the optimal one, with the true P.

Source: Astrom and Wittenmark, Computer-Controlled Systems, section 11.4. Law: tests/laws/test_expected_cost.py.
"""

from __future__ import annotations

import numpy as np

from fusiond.control.plant import Plan
from fusiond.numerics.riccati import Matrix


def expected_cost(plan: Plan, P: Matrix) -> float:
    """J*, per second: of the plant's cost, the integrals' included where there are any.

    Args:
        P: (n, n) covariance of the estimate's error of the plant's own states when a command is computed.
    """
    plant = plan.plant
    n, N, m = plant.states, len(plan.S), plant.controls
    W, B = np.zeros((N, N)), np.zeros((N, m))
    W[:n, :n] = plant.W
    B[: len(plant.F)] = plant.B
    R = plant.cost[len(plant.F) :, len(plant.F) :]
    K = np.hstack([plan.K, plan.L])[:, :n]
    weight = K.T @ (R + B.T @ plan.S @ B) @ K
    return float((np.trace(plan.S @ W) + np.trace(weight @ P)) / plant.period_s)
