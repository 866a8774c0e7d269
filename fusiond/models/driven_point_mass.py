"""A point mass driven by its measured acceleration; optionally the accelerometer's bias is a state.

    position'          = velocity
    velocity'          = acceleration - acceleration_bias - gravity + white noise
    acceleration_bias' = white noise

Source: seed 000, equations 9 to 14; the bias state is what its claim needs (docs/seeds.md). Gravity is for an
accelerometer that measures specific force; the seed's measures kinematic acceleration, so its gravity is 0.
"""

from __future__ import annotations

from fusiond.models.contract import Process
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Slot


def describe(
    *,
    bias: bool = True,
    gravity_m_s2: float = 0.0,
    velocity_noise_m_s_sqrt_s: float = 0.0,
    bias_noise_m_s2_sqrt_s: float = 0.0,
) -> Process:
    """Describe the model.

    Args:
        bias: estimate the accelerometer's bias as a third state.
        gravity_m_s2: subtracted from the measured acceleration.
        velocity_noise_m_s_sqrt_s: random walk of the velocity, (m/s)/sqrt(s); the accelerometer's own noise comes
            on top, from its `noise_std`.
        bias_noise_m_s2_sqrt_s: random walk of the bias, (m/s^2)/sqrt(s).
    """
    states = (Slot("position", "m"), Slot("velocity", "m_s"), Slot("acceleration_bias", "m_s2"))
    return Process(
        states=states if bias else states[:2],
        inputs=(Slot("acceleration", "m_s2"),),
        noises=5 if bias else 2,
        parameters=(gravity_m_s2, velocity_noise_m_s_sqrt_s**2, bias_noise_m_s2_sqrt_s**2),
        linear=True,
    )


@kernel
def discretise(dt_s: float, p: Vector, F: Matrix, B: Matrix, c: Vector, G: Matrix, q: Vector) -> None:
    """Exact for an acceleration held over the interval; the integrated noises are factored by hand."""
    n = F.shape[0]
    for i in range(n):
        F[i, i] = 1.0
    F[0, 1] = dt_s
    B[0, 0] = 0.5 * dt_s * dt_s
    B[1, 0] = dt_s
    c[0] = -p[0] * B[0, 0]
    c[1] = -p[0] * B[1, 0]
    # velocity walk: [[dt^3/3, dt^2/2], [dt^2/2, dt]] = U diag(dt^3/12, dt) U'
    G[0, 0] = 1.0
    G[0, 1] = 0.5 * dt_s
    G[1, 1] = 1.0
    q[0] = p[1] * dt_s**3 / 12.0
    q[1] = p[1] * dt_s
    if n == 3:
        F[0, 2] = -B[0, 0]
        F[1, 2] = -dt_s
        # bias walk, integrated twice: the 3 x 3 covariance with dt^5/20 at its corner, as U diag() U'
        G[0, 2] = 1.0
        G[0, 3] = 0.5 * dt_s
        G[1, 3] = 1.0
        G[0, 4] = -dt_s * dt_s / 6.0
        G[1, 4] = -0.5 * dt_s
        G[2, 4] = 1.0
        q[2] = p[2] * dt_s**5 / 720.0
        q[3] = p[2] * dt_s**3 / 12.0
        q[4] = p[2] * dt_s
