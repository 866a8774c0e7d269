"""The ill-conditioned update of Grewal and Andrews: H = [1 1 1; 1 1 1+d], R = d^2 I, P = I, against exact fractions."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from fusiond.filters import conventional, information, joseph, ud
from fusiond.filters.innovation import Innovation

Floats = NDArray[np.float64]
UPDATES = {
    "conventional": conventional.update, "joseph": joseph.update, "information": information.update,
    "by inverse": information.update_by_inverse, "ud": ud.update,
}  # fmt: skip


def exact(d: float) -> Floats:
    """I - H' (H H' + R)^-1 H in fractions of the numbers as they are, rounded once at the end."""
    one, e = Fraction(1), Fraction(1.0 + d)
    r, H = Fraction(d * d), ((one, one, one), (one, one, e))
    S = [
        [sum(a * b for a, b in zip(H[i], H[j], strict=True)) + (r if i == j else 0) for j in (0, 1)]
        for i in (0, 1)
    ]
    determinant = S[0][0] * S[1][1] - S[0][1] * S[1][0]
    inverse = [
        [S[1][1] / determinant, -S[0][1] / determinant],
        [-S[1][0] / determinant, S[0][0] / determinant],
    ]
    P = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            taken = sum(H[a][i] * inverse[a][b] * H[b][j] for a in (0, 1) for b in (0, 1))
            P[i, j] = float((1 if i == j else 0) - taken)
    return P


def outcome(name: str, d: float) -> tuple[float, float]:
    """Error of P+ relative to the exact one (infinite where the update failed), and its smallest eigenvalue."""
    H, R = np.array([[1.0, 1.0, 1.0], [1.0, 1.0, 1.0 + d]]), np.diag([d * d, d * d])
    truth = exact(d)
    P = UPDATES[name](np.zeros(3), np.eye(3), Innovation(np.zeros(2), H, R))[1]
    error = np.linalg.norm(P - truth) / np.linalg.norm(truth)
    return float(error), float(np.linalg.eigvalsh(0.5 * (P + P.T))[0])
