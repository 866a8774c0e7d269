"""What a center knows whose nodes send one tracklet for several readings: the joint error covariance of all of them.

Each node filters with the whole of Q, and at a message sends what its posterior P_i knows beyond its last message
predicted to now, S_i:

    Y_i = P_i^-1 - S_i^-1,   y_i = P_i^-1 x_i - S_i^-1 x_i(sent),   P^-1 += sum Y_i,   P^-1 x += sum y_i

With a message for every reading that is exact. Between messages the noise of the process is common to all of them,
and is counted once by each.
"""

from __future__ import annotations

import numpy as np

from tools.pages.bank_truth import Floats, Known, System, corrected, optimal


def thinned(system: System, every: int, messages: int) -> Known:
    """Run nodes and center until the given number of messages has been fused.

    Args:
        every: steps, each with a reading of every node, from one message to the next.
    """
    n, count = system.A.shape[0], len(system.C)
    unit, blocks = np.eye(n), 2 * count + 1
    P, sent = [system.P0] * count, [system.P0] * count
    center: Floats = system.P0
    J: Floats = np.asarray(np.kron(np.ones((blocks, blocks)), system.P0), dtype=np.float64)
    moves, shaken = np.kron(np.eye(blocks), system.A), np.kron(np.ones((blocks, blocks)), system.Q)
    for step in range(every * messages):
        if step:
            P, sent = [[system.A @ each @ system.A.T + system.Q for each in some] for some in (P, sent)]
            center = system.A @ center @ system.A.T + system.Q
            J = moves @ J @ moves.T + shaken
        kept, noise = np.eye(blocks * n), np.zeros_like(J)
        for i, (C, R) in enumerate(zip(system.C, system.R, strict=True)):
            M, P[i] = corrected(P[i], C, R)
            kept[place(i, n), place(i, n)], noise[place(i, n), place(i, n)] = unit - M @ C, M @ R @ M.T
        J = kept @ J @ kept.T + noise
        if (step + 1) % every == 0:
            center, weights = fused(center, P, sent)
            J = weights @ J @ weights.T
            sent = list(P)
    return Known(center, J[:n, :n], optimal(system, every * messages))


def place(i: int, n: int) -> slice:
    """Where node i's error stands in the stack of errors: center, nodes, what each of them sent last."""
    return slice((1 + i) * n, (2 + i) * n)


def fused(center: Floats, P: list[Floats], sent: list[Floats]) -> tuple[Floats, Floats]:
    """The center's covariance after one message of every node, and how the stack of errors moves."""
    n, count = center.shape[0], len(P)
    know = [np.linalg.inv(each) for each in (center, *P)]
    knew = [np.linalg.inv(each) for each in sent]
    after = np.linalg.inv(sum(know[1:], know[0]) - sum(knew[1:], knew[0]))
    weights = np.eye((2 * count + 1) * n)
    weights[:n] = after @ np.hstack([*know, *(-each for each in knew)])
    for i in range(count):
        weights[place(count + i, n)] = weights[place(i, n)]
    return after, weights
