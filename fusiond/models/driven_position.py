"""A position driven by its measured velocity.

    position' = velocity + white noise

Source: seed 001, F = 1, B = dt. The seed's prediction uses u(i-1) where u(i) is the velocity over (i-1, i): configure
the speed sensor with `hold = "previous"` for the corrected filter, `"next"` for the seed as written.
"""

from __future__ import annotations

from fusiond.models.contract import Process
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Slot


def describe(*, position_noise_m_sqrt_s: float = 0.0) -> Process:
    """Describe the model.

    Args:
        position_noise_m_sqrt_s: random walk of the position, m/sqrt(s), on top of the speed sensor's noise.
    """
    return Process(
        states=(Slot("position", "m"),),
        inputs=(Slot("velocity", "m_s"),),
        noises=1,
        parameters=(position_noise_m_sqrt_s**2,),
        linear=True,
    )


@kernel
def discretise(dt_s: float, p: Vector, F: Matrix, B: Matrix, c: Vector, G: Matrix, q: Vector) -> None:
    """Exact."""
    F[0, 0] = 1.0
    B[0, 0] = dt_s
    G[0, 0] = 1.0
    q[0] = p[0] * dt_s
