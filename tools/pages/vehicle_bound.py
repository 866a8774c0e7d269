"""The posterior Cramer-Rao bound of seed 002's filter on its own model, and how near the filter comes to it.

The bound along a drive is the covariance recursion of the filter's own equations linearised at the truth,
P- = F P F' + Q, P = (I + P- H' R^-1 H)^-1 P-, which is J = (Q + F J^-1 F')^-1 + H' R^-1 H (Tichavsky 1998) written so
that a singular Q does no harm, averaged over drives. What separates a filter from it is that the filter linearises at
its estimate.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from fusiond.assembly.assembly import Assembly
from fusiond.assembly.resolve import Resolved
from fusiond.engine.engine import Engine
from fusiond.numerics.kernel import interpreted
from fusiond.simulation.streams import stream
from fusiond.simulation.tables import Floats
from fusiond.simulation.vehicle_equations import Disturbance, drive
from fusiond.simulation.vehicle_manoeuvres import BEGIN_S, Manoeuvre
from fusiond.simulation.vehicle_sensors import MILLISECOND_NS, SLOW, Motion, readings
from tools.pages.trials import configured
from tools.pages.vehicle_runs import DT_S, SEED_STATES, Drive, car_of, follow, model_of

CRUISE_N = 100.0
"""Of each rear wheel in the ensemble; 5 % of it is the configured noise of a wheel's force."""
START_STD = {
    "vx_m_s": 1.0, "vy_m_s": 0.2, "yaw_rate_rad_s": 0.02, "force_front_n": 200.0, "force_rear_n": 200.0,
    "yaw_rad": 0.05, "x_m": 1.0, "y_m": 1.0,
}  # fmt: skip
"""Spread of the ensemble's starts: what the bound assumes is known at first, so the filter is told the same."""
UNKNOWN_M_S2 = 5.0
"""Of the two specific forces before the first interval; nothing comes of it."""


@dataclass(frozen=True, slots=True)
class Ensemble:
    """Independent drives of the filter's own model, from its own prior, with its own disturbances."""

    assembly: Assembly
    motions: tuple[Motion, ...]

    def follow(self, engine: Engine, seed: int) -> Iterator[Drive]:
        """The filter on one drive after the other; readings of run k are those of seed + k."""
        force_std_n = self.assembly.config.sensor["applied"].noise_std["drive_rear_left_n"]
        for k, motion in enumerate(self.motions):
            yield follow(engine, motion, readings(motion, seed + k, force_std_n))


def ensemble(asked: Manoeuvre, runs: int, duration_s: float, seed: int = 0) -> Ensemble:
    """Drives that steer as the manoeuvre does from its beginning on, while the axle forces wander as assumed."""
    mean = {"vx_m_s": asked.speed_m_s}
    start = {"state": mean, "std": {**START_STD, "ax_m_s2": UNKNOWN_M_S2, "ay_m_s2": UNKNOWN_M_S2}}
    assembly = configured("ground_vehicle", {"initial": start})
    model = model_of(assembly)
    disturbance = Disturbance(
        model["force_noise_n_sqrt_s"],
        model["specific_force_noise_m_s2_sqrt_hz"],
        model["yaw_acceleration_noise_rad_s2_sqrt_hz"],
    )
    steps = round(duration_s / DT_S)
    rng = stream(seed, f"vehicle/{asked.name}")
    centre = np.array([asked.speed_m_s, *([0.0] * 7)])
    spread = np.array(list(START_STD.values()))
    first = centre + spread * rng.standard_normal((runs, 8))
    steering = np.array([asked.steering_rad(BEGIN_S + k * DT_S) for k in range(steps + 1)])
    wheels = np.broadcast_to([0.0, 0.0, CRUISE_N, CRUISE_N], (steps + 1, 4)).copy()
    states = drive(car_of(model), disturbance, first, wheels[:-1], steering[:-1], None, DT_S, rng)
    t_ns = np.arange(steps + 1, dtype=np.int64) * MILLISECOND_NS
    return Ensemble(assembly, tuple(Motion(t_ns, states[:, k], wheels, steering) for k in range(runs)))


@dataclass(frozen=True, slots=True)
class Score:
    """How near the filter comes to the bound, state by state, the seed's eight.

    ratio: RMSE over bound, all drives and milliseconds together.   ratio_std: its standard error, from the scatter
    of the drives.   nees: (drives,) at the end of each.
    """

    ratio: Floats
    ratio_std: Floats
    nees: Floats


def score(made: Ensemble, engine: Engine, seed: int, bounded: int = 10) -> Score:
    """Follow the ensemble and compare.

    Args:
        bounded: drives whose bound is computed. It differs little from the filter's own covariance, so the mean over
            all drives is that of the filter's own times the ratio of the two on these.
    """
    squares, own, nees = [], [], []
    for one in made.follow(engine, seed):
        squares.append(np.mean(one.error[:, :SEED_STATES] ** 2, axis=0))
        own.append(np.mean(np.diagonal(one.P, axis1=1, axis2=2)[:, :SEED_STATES], axis=0))
        nees.append(one.nees(-1))
    exact = [
        bound(made.assembly.resolved, motion)[:, :SEED_STATES].mean(axis=0)
        for motion in made.motions[:bounded]
    ]
    best = np.mean(own, axis=0) * np.sum(exact, axis=0) / np.sum(own[:bounded], axis=0)
    mean = np.mean(squares, axis=0)
    scatter = np.std(squares, axis=0, ddof=1) / np.sqrt(len(squares)) / mean
    ratio = np.sqrt(mean / best)
    return Score(ratio, 0.5 * ratio * scatter, np.array(nees))


def bound(resolved: Resolved, motion: Motion, start_std: Mapping[str, float] = START_STD) -> Floats:
    """(n, 10) variances of the bound along one drive, a row a millisecond from the second on."""
    process = resolved.process
    P = np.diag([start_std.get(slot.key, UNKNOWN_M_S2) ** 2 for slot in process.states])
    P = _conditioned(P, resolved, motion.states[0], ("gps", "magnetometer"))
    variances = np.zeros((motion.t_ns.size - 1, len(process.states)))
    for k in range(motion.t_ns.size - 1):
        u = np.append(motion.drive_n[k], motion.steering_rad[k])
        P = _predicted(P, resolved, motion.states[k], u)
        slow = ("gps", "magnetometer") if (k + 1) % SLOW == 0 else ()
        P = _conditioned(P, resolved, motion.states[k + 1], ("imu", *slow))
        variances[k] = np.diag(P)
    return variances


def _predicted(P: Floats, resolved: Resolved, x: Floats, u: Floats) -> Floats:
    """F P F' + Q over a millisecond from the state x under the inputs u, the inputs' own noise in Q."""
    process, module = resolved.process, resolved.process_module
    n, inputs, noises = len(process.states), len(process.inputs), process.noises
    F, B = np.zeros((n, n)), np.zeros((n, inputs))
    G, q = np.zeros((n, noises)), np.zeros(noises)
    p = np.array(process.parameters)
    interpreted(module.transition)(x, u, DT_S, p, np.zeros(n), F, B)
    interpreted(module.noise)(x, DT_S, p, G, q)
    told = next(sensor for sensor in resolved.sensors if sensor.name == "applied")
    return np.asarray(F @ P @ F.T + (G * q) @ G.T + (B * np.diag(told.R)) @ B.T)


def _conditioned(P: Floats, resolved: Resolved, x: Floats, names: tuple[str, ...]) -> Floats:
    """(I + P H' R^-1 H)^-1 P for the readings of one moment."""
    places = {slot.name: place for place, slot in enumerate(resolved.process.states)}
    information = np.zeros_like(P)
    for sensor in resolved.sensors:
        if sensor.name not in names or sensor.module is None:
            continue
        at = np.array([places[slot] for slot in sensor.model.reads], dtype=np.int64)
        dof = sensor.model.dof
        h, H = np.zeros(dof), np.zeros((dof, len(x)))
        parameters = np.array(sensor.model.parameters or (0.0,))
        interpreted(sensor.module.observe)(x, np.zeros(dof), at, parameters, h, H)
        information += H.T @ np.linalg.solve(sensor.R, H)
    after = np.linalg.solve(np.eye(len(x)) + P @ information, P)
    return np.asarray(0.5 * (after + after.T))
