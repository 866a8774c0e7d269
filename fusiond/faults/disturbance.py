"""The model as an explanation: the state was moved, or everything scatters otherwise than declared.

A disturbance d of the state before entry o gives all later innovations, of every sensor, the means G d that the running
filter makes of it. Its information A(o) and matched sum b(o) follow backwards from the last entry:

    A(o) = G_o'G_o + F_o' A(o+1) F_o,    b(o) = G_o'e_o + F_o' b(o+1),    GLR = b' A^-1 b / 2,

with F_o what the entry leaves of an error and G_o what its innovations show of it. Source: Willsky & Jones 1976.
"""

from __future__ import annotations

import numpy as np

from fusiond.faults.glr import unforeseen
from fusiond.faults.response import Integers, Response
from fusiond.faults.spread import pooled
from fusiond.numerics.ud import Matrix

RARITY = 3.0
"""Log odds, beforehand, of one sensor's fault over a failure of the model."""
RANK = 1e-8
"""Directions of the state with a smaller share of the largest information are not seen."""


def _backwards(response: Response) -> tuple[Matrix, Matrix]:
    """(o, n, n) and (o, n): A and b of a disturbance before each entry tried, last entry first."""
    steps, n = response.steps, response.steps.error.shape[1]
    tried = set(_tried(response).tolist())
    A: Matrix = np.zeros((n, n))
    b = np.zeros(n)
    row = len(response.e)
    informations, matched = [], []
    for k in range(len(response) - 1, -1, -1):
        dof = int(response.dof[k])
        G, F, e = steps.from_error[k, :dof], steps.error[k], response.e[row - dof : row]
        A, b, row = G.T @ G + F.T @ A @ F, G.T @ e + F.T @ b, row - dof
        if k in tried:
            informations.append(A)
            matched.append(b)
    return np.array(informations), np.array(matched)


def _filtered(response: Response, filtered: Matrix) -> tuple[Matrix, Matrix]:
    """The same where the innovations have been through a filter: the means themselves go through it."""
    steps, row, tried = response.steps, len(response.e), set(_tried(response).tolist())
    mean: Matrix = np.zeros((row, steps.error.shape[1]))
    kept = []
    for k in range(len(response) - 1, -1, -1):
        dof = int(response.dof[k])
        mean[row:] = mean[row:] @ steps.error[k]
        row -= dof
        mean[row : row + dof] = steps.from_error[k, :dof]
        if k in tried:
            kept.append(filtered[:, row:] @ mean[row:])
    seen = np.array(kept)
    return np.einsum("oei,oej->oij", seen, seen), np.einsum("oei,e->oi", seen, response.e)


def _tried(response: Response) -> Integers:
    """Entries before which a disturbance is looked for: those that begin a fold of the inputs."""
    return np.unique(response.begins_input)


def _moved(response: Response) -> float:
    """Best score of a sudden change of the state, in any direction that is seen."""
    way = response.filtered
    informations, matched = _backwards(response) if way is None else _filtered(response, way)
    lengths, V = np.linalg.eigh(informations)
    y2 = np.einsum("wji,wj->wi", V, matched) ** 2
    seen = lengths > RANK * lengths[:, -1:]
    each = np.where(seen, 0.5 * y2 / np.where(seen, lengths, 1.0) - unforeseen(1.0), 0.0)
    return float(np.max(np.sum(np.maximum(each, 0.0), axis=1)) - np.log(len(each)))


def model_score(response: Response) -> float:
    """Score of the better of the two explanations that convict the model, comparable to that of a `Fit`."""
    scatter = pooled(response) - unforeseen(1.0) - float(np.log(len(response)))
    return max(_moved(response), scatter) - RARITY
