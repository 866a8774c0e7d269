"""Regulators: the Riccati equation, python-control, exact sampling, delays, and the cost they really have."""

from __future__ import annotations

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad_vec
from scipy.linalg import expm

from fusiond.control.plant import parts, queued, sampled, targets
from fusiond.errors import ConfigError
from fusiond.numerics.riccati import Unsolvable, generator, hold, regulator, riccati_residual

A = np.array([[1.1269, -0.4940, 0.1129], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
B = np.array([[-0.3832], [0.5919], [0.5191]])
C = np.array([[1.0, 0.0, 0.0]])
DOUBLE = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]])


def cost_of(Q, R, N=None):
    n, m = len(Q), len(R)
    whole = np.zeros((n + m, n + m))
    whole[:n, :n], whole[n:, n:] = Q, R
    if N is not None:
        whole[:n, n:], whole[n:, :n] = N, N.T
    return whole


REFERENCE = cost_of(C.T @ C, np.array([[0.1]]))


@given(st.integers(0, 200))
def test_the_gain_is_python_controls_and_solves_the_riccati_equation(seed):
    """Random plants of three states and two controls, cross weight included."""
    rng = np.random.default_rng(seed)
    F, G = 0.6 * rng.standard_normal((3, 3)), rng.standard_normal((3, 2))
    root = rng.standard_normal((5, 5))
    cost = root @ root.T + 0.1 * np.eye(5)
    K, S = regulator(F, G, cost)
    theirs, cost_to_go, _ = control.dlqr(F, G, cost[:3, :3], cost[3:, 3:], cost[:3, 3:])
    assert np.allclose(K, theirs, rtol=1e-7, atol=1e-9)
    assert np.allclose(S, cost_to_go, rtol=1e-7, atol=1e-9)
    assert riccati_residual(F, G, cost, S, K) < 1e-9
    assert riccati_residual(F, G, cost, S, K + 1e-3) > 1e-5


def test_the_cost_to_go_is_what_the_rest_of_the_run_costs():
    """x' S x, summed step by step; any other gain costs more."""
    K, S = regulator(A, B, REFERENCE)

    def total(gain):
        x, spent = np.array([1.0, -2.0, 0.5]), 0.0
        for _ in range(400):
            z = np.concatenate([x, -gain @ x])
            spent += z @ REFERENCE @ z
            x = A @ x - B @ (gain @ x)
        return spent

    x0 = np.array([1.0, -2.0, 0.5])
    assert total(K) == pytest.approx(x0 @ S @ x0, rel=1e-10)
    assert total(1.05 * K) > total(K)
    assert total(0.95 * K) > total(K)


def test_what_cannot_be_regulated_is_refused():
    with pytest.raises(Unsolvable):
        regulator(np.diag([1.2, 0.5]), np.array([[0.0], [1.0]]), np.eye(3))


def test_sampling_is_exact_and_has_a_cross_weight():
    """Against the integral of the cost along x(s) = exp(A s) x + ... , u held, by quadrature."""
    dt_s = 0.4
    F, G, cost = hold(*DOUBLE, cost_of(np.diag([2.0, 1.0]), np.array([[0.5]])), dt_s)
    block = np.zeros((3, 3))
    block[:2, :2], block[:2, 2:] = DOUBLE
    density = cost_of(np.diag([2.0, 1.0]), np.array([[0.5]]))
    exact = quad_vec(lambda s: expm(block * s).T @ density @ expm(block * s), 0.0, dt_s)[0]
    assert np.allclose(cost, exact, atol=1e-12)
    assert np.allclose(np.hstack([F, G]), expm(block * dt_s)[:2], atol=1e-14)
    assert abs(cost[0, 2]) > 1e-3


def test_a_held_plant_gives_its_continuous_one_back():
    F, G, _ = hold(*DOUBLE, np.zeros((3, 3)), 0.1)
    back = generator(F, G, 0.1)
    assert np.allclose(back[0], DOUBLE[0], atol=1e-12)
    assert np.allclose(back[1], DOUBLE[1], atol=1e-12)


@pytest.mark.parametrize("delay_s", [0.0, 0.03, 0.1, 0.25])
def test_a_late_command_acts_when_it_should(delay_s):
    """The sampled plant with its queue against the continuous one integrated in steps of a millisecond."""
    period_s, rng = 0.1, np.random.default_rng(3)
    plant = sampled(*DOUBLE, cost_of(np.eye(2), np.eye(1)), np.zeros((2, 2)), period_s, delay_s)
    commands = rng.standard_normal(12)
    z, fine = np.zeros(len(plant.F)), np.zeros(2)
    step = expm(np.block([[DOUBLE[0], DOUBLE[1]], [np.zeros((1, 3))]]) * 1e-3)[:2]
    spent, walked = 0.0, 0.0
    for k, u in enumerate(commands):
        both = np.append(z, u)
        spent += both @ plant.cost @ both
        for ms in range(100):
            since = k * 100 + ms - round(delay_s * 1000)
            acting = commands[since // 100] if since >= 0 else 0.0
            walked += 1e-3 * (fine @ fine + acting**2)
            fine = step @ np.append(fine, acting)
        z = plant.F @ z + plant.B[:, 0] * u
        assert np.allclose(z[:2], fine, atol=1e-9)
    assert spent == pytest.approx(walked, rel=2e-3)


def test_parts_of_a_delay():
    assert parts(0.25, 0.1) == (2, pytest.approx(0.05))
    assert parts(0.3, 0.1) == (3, 0.0)
    assert parts(0.0, 1.0) == (0, 0.0)


def test_the_target_is_where_the_plant_rests():
    """xs = F xs + B us + E d, C xs the reference, feedforward on top; more references than controls are refused."""
    plant = queued(A, B, REFERENCE, np.zeros((3, 3)), 0, 1.0)
    E = np.array([[0.1], [0.0], [0.2]])
    aim = targets(plant, C, E, np.array([0.7])) @ np.array([2.0, -1.0, 1.0])
    xs, us = aim[:3], aim[3] - 0.7
    assert np.allclose(A @ xs + B[:, 0] * us + E[:, 0] * -1.0, xs)
    assert xs[0] == pytest.approx(2.0)
    with pytest.raises(ConfigError, match="cannot rest"):
        targets(plant, np.eye(3), np.zeros((3, 0)), np.zeros(1))
