from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from fusiond.faults.course import Suspect
from fusiond.faults.disturbance import model_score
from fusiond.faults.forecast import separate
from fusiond.faults.glr import EXPECTED, fit_signature, scan
from fusiond.faults.ground import basis, free, ground_of, information
from fusiond.faults.hypotheses import Hypothesis, catalogue
from fusiond.faults.identification import identify
from fusiond.faults.response import Response, respond
from fusiond.faults.spread import fit_factor
from fusiond.types import Kind
from tests.laws.glr_rig import (
    Fault,
    Matrix,
    Plant,
    Run,
    constant_velocity,
    integrator,
    minicar,
    reference,
)

ONSET = 12


def planar() -> Plant:
    """Position twice, once with correlated noise, and velocity, in the plane."""
    one = np.array([[1.0, 0.1], [0.0, 1.0]])
    A, G = np.kron(np.eye(2), one), np.kron(np.eye(2), np.array([[0.005], [0.1]]))
    place, speed = np.kron(np.eye(2), [[1.0, 0.0]]), np.kron(np.eye(2), [[0.0, 1.0]])
    correlated = np.array([[0.25, 0.1], [0.1, 0.25]])
    noise = (np.eye(2) * 0.25, correlated, np.eye(2) * 0.04)
    return Plant(A, G @ G.T, (place, place, speed), noise, G[:, :1], 0.1)


def spoilt(
    plant: Plant,
    fault: Mapping[int, Fault],
    *,
    readings: int = 30,
    onset: int = ONSET,
    input_fault: float = 0.0,
) -> Response:
    """The window of a run whose fault begins after `onset` steps."""
    run = Run(plant, seed=3)
    for k in range(readings):
        active = {i: (lambda k, h, f=f: f(k - onset, h)) for i, f in fault.items()} if k >= onset else {}
        run.step(fault=active, input_fault=input_fault if k >= onset else 0.0)
    return respond(run.window(len(run.lines)), 1)


def constant(*size: float) -> Fault:
    return lambda k, h: np.array(size)


def ramp(slope: float) -> Fault:
    """So much per second, on the first of two channels, at 10 readings a second."""
    return lambda k, h: 0.1 * k * np.array([slope, 0.0])


def once(k: int, h: Matrix) -> Matrix:
    return np.array([float(k == 0), 0.0])


CASES = [
    (reference(2), {0: constant(1.0)}, Hypothesis(Kind.BIAS, ((Suspect(0, 0, False),),)), 0.0),
    (constant_velocity(2), {1: constant(1.0)}, Hypothesis(Kind.BIAS, ((Suspect(1, 0, False),),)), 0.0),
    (planar(), {1: constant(0.0, 1.0)}, Hypothesis(Kind.BIAS, ((Suspect(1, 1, False),),)), 0.0),
    (
        planar(),
        {0: constant(1.0, 1.0), 1: constant(1.0, 1.0)},
        Hypothesis(Kind.BIAS, (tuple(Suspect(s, c, False) for s in (0, 1) for c in (0, 1)),)),
        0.0,
    ),
    (planar(), {2: ramp(1.0)}, Hypothesis(Kind.DRIFT, ((Suspect(2, 0, False),),)), 0.0),
    (planar(), {0: once}, Hypothesis(Kind.SPIKE, ((Suspect(0, 0, False),),)), 0.0),
    (minicar(), {}, Hypothesis(Kind.BIAS, ((Suspect(5, 0, True),),)), 1.0),
]  # fmt: skip


def number_of(response: Response, hypothesis: Hypothesis, step: int) -> int:
    """Among the entries of a place the one of this step of the plant."""
    ground = ground_of(response, hypothesis.place, (0,) if hypothesis.place == (5,) else ())
    stamps = np.unique(response.t_ns)
    return int(np.searchsorted(response.t_ns[ground.entries], stamps[step]))


@pytest.mark.parametrize(("plant", "fault", "hypothesis", "input_fault"), CASES)
def test_a_signature_is_what_the_filter_does(
    plant: Plant, fault: Mapping[int, Fault], hypothesis: Hypothesis, input_fault: float
) -> None:
    """The same readings with and without a unit fault differ in their innovations by its signature, to rounding."""
    clean, faulty = spoilt(plant, {}), spoilt(plant, fault, input_fault=input_fault)
    fit = scan(clean, [hypothesis])[0]
    number = number_of(clean, hypothesis, ONSET)

    signature = np.sum(basis(fit.ground, hypothesis, number), axis=1)
    np.testing.assert_allclose(faulty.e - clean.e, signature, atol=1e-9 * np.max(np.abs(signature)))


@pytest.mark.parametrize(("plant", "fault", "hypothesis", "input_fault"), CASES)
def test_information_is_the_signatures_own(
    plant: Plant, fault: Mapping[int, Fault], hypothesis: Hypothesis, input_fault: float
) -> None:
    """For every onset a and b equal the sums over the explicit signature, and the GLR is the least squares fit's."""

    response = spoilt(plant, fault, input_fault=input_fault)
    fit = scan(response, [hypothesis])[0]
    a, b = information(fit.ground, hypothesis)
    for number in range(len(fit.ground.entries)):
        w = basis(fit.ground, hypothesis, number)
        np.testing.assert_allclose(a[number], w.T @ w, rtol=1e-6, atol=1e-9 * np.max(a))
        np.testing.assert_allclose(b[number], w.T @ response.e, rtol=1e-6, atol=1e-7 * np.max(np.abs(b)))
    w = fit.basis()
    size = np.linalg.lstsq(w, response.e, rcond=None)[0]
    np.testing.assert_allclose(fit.size, size, rtol=1e-6)
    assert fit.glr == pytest.approx(0.5 * float(np.sum((w @ size) ** 2)), rel=1e-6)


@pytest.mark.parametrize(("plant", "fault", "hypothesis", "input_fault"), CASES[:4] + CASES[6:])
def test_a_long_window_folds_its_old_readings_and_loses_nothing_of_a_lasting_error(
    plant: Plant, fault: Mapping[int, Fault], hypothesis: Hypothesis, input_fault: float
) -> None:
    """300 readings of each sensor in 128 columns: a bias from the first on differs by its signature, to rounding."""
    readings = {"readings": 300, "onset": 0}
    clean, faulty = spoilt(plant, {}, **readings), spoilt(plant, fault, input_fault=input_fault, **readings)
    fit = scan(clean, [hypothesis])[0]
    assert len(fit.ground.entries) < 300
    signature = np.sum(basis(fit.ground, hypothesis, 0), axis=1)
    np.testing.assert_allclose(faulty.e - clean.e, signature, atol=1e-9 * np.max(np.abs(signature)))


def test_errors_of_any_shape_leave_the_filter_without_the_sensor() -> None:
    """Projecting a sensor's readings out leaves the squares of the filter that never heard it."""
    plant = constant_velocity(2)
    run = Run(plant, seed=5)
    lone = Run(Plant(plant.A, plant.Q, plant.H[:1], plant.R[:1], plant.B, plant.dt_s), seed=5)
    lone.P, lone.xhat = run.P.copy(), run.xhat.copy()
    for _ in range(20):
        run.step()
        z0 = run.lines[-2]["h"][0] + run.lines[-2]["e"][0] * run.lines[-2]["root"][0]
        lone.x = lone.x * np.nan
        _hear(lone, float(z0))
    response = respond(run.window())
    removed, count = free(ground_of(response, (1,)), 0)
    left = float(np.sum(response.e**2)) - removed
    assert count == 20
    assert left == pytest.approx(sum(float(line["e"][0]) ** 2 for line in lone.lines), rel=1e-8)


def _hear(run: Run, z: float) -> None:
    """One step of a filter on a given reading of its first sensor."""
    plant, H, R = run.plant, run.plant.H[0], run.plant.R[0]
    run.xhat, run.P = plant.A @ run.xhat, plant.A @ run.P @ plant.A.T + plant.Q
    S = float((H @ run.P @ H.T + R)[0, 0])
    nu, K = z - float((H @ run.xhat)[0]), (run.P @ H.T)[:, 0] / S
    line = np.zeros(1, run.dtype)[0]
    line["e"][0] = nu / np.sqrt(S)
    run.xhat, run.P = run.xhat + K * nu, run.P - np.outer(K, K) * S
    run.lines.append(line)


def test_the_evidence_is_the_likelihood_of_all_sizes_and_onsets() -> None:
    """Within half a nat of the exact integral, which weighs the sizes by their prior as well."""
    response = spoilt(reference(1), {0: constant(6.0)}, readings=ONSET + 6)
    bias = Hypothesis(Kind.BIAS, ((Suspect(0, 0, is_input=False),),))
    fit = fit_signature(ground_of(response, (0,), ()), bias)
    a, b = information(fit.ground, bias)
    V = EXPECTED**2 * float(fit.ground.variance[0])
    each = 0.5 * b[:, 0] ** 2 / (a[:, 0, 0] + 1.0 / V) - 0.5 * np.log1p(V * a[:, 0, 0])
    exact = float(np.logaddexp.reduce(each)) - np.log(len(each))
    assert fit.evidence == pytest.approx(exact, abs=0.5)
    assert fit.evidence > fit.score


def test_the_likelihood_of_a_noise_factor_is_the_normal_densitys() -> None:
    rng = np.random.default_rng(1)
    Z = np.linalg.qr(rng.standard_normal((30, 9)))[0] * rng.uniform(0.3, 1.0, 9)
    e = rng.standard_normal(30) + 3.0 * Z @ rng.standard_normal(9)
    factor, _, llr, _ = fit_factor(Z.T @ Z, Z.T @ e)

    def dense(f: float) -> float:
        cov: Matrix = np.eye(30) + (f**2 - 1.0) * Z @ Z.T
        return 0.5 * float(e @ e - e @ np.linalg.solve(cov, e) - np.linalg.slogdet(cov)[1])

    assert llr == pytest.approx(dense(factor), rel=1e-9)
    assert all(dense(factor) >= dense(factor * k) - 1e-3 for k in (0.5, 0.9, 0.97, 1.03, 1.1, 2.0))


@pytest.mark.parametrize(
    ("plant", "sine2"),
    [(integrator(2), 0.0), (integrator(3), 0.75), (reference(2), np.sin(np.radians(23.8)) ** 2)],
)
def test_the_forecast_knows_the_angle_between_two_biases(plant: Plant, sine2: float) -> None:
    """In the long run equal sensors part by theory's angle: 0, 0.75 (two and three on an integrator), 23.8 degrees."""
    sensors = len(plant.H)
    response = spoilt(plant, {0: constant(5.0)}, readings=60, onset=30)
    grounds = [ground_of(response, (sensor,)) for sensor in (0, 1)]
    one, other = (
        fit_signature(ground, Hypothesis(Kind.BIAS, ((Suspect(sensor, 0, False),),)))
        for sensor, ground in enumerate(grounds)
    )
    (apart,) = separate(one, [other], [400 * sensors])
    assert apart.sine2 == pytest.approx(sine2, abs=0.01 if sine2 else 1e-6)


def test_a_moved_state_convicts_the_model() -> None:
    """A jump of the state is explained by the model better than by any sensor's fault."""
    run = Run(planar(), seed=2)
    for k in range(30):
        run.x = run.x + (np.array([3.0, 0.0, -3.0, 0.0]) if k == 20 else 0.0)
        run.step()
    response = respond(run.window())
    fits = scan(response, catalogue({0: 2, 1: 2, 2: 2}))
    assert model_score(response) > fits[0].score + 4.6


def test_sizes_come_with_their_units() -> None:
    """A scale is reported as a factor, a drift per second, each within three of its standard deviations."""
    run = Run(constant_velocity(2), seed=4)
    run.x, run.xhat = run.x + np.array([5.0, 8.0]), run.xhat + np.array([5.0, 8.0])
    for k in range(60):
        run.step(fault={1: lambda k, h: 0.07 * h} if k >= 20 else {}, u=6.0 * np.sin(k / 5.0))
    hypotheses = [h for h in catalogue({0: 1, 1: 1}) if h.kind is Kind.SCALE and h.place == (1,)]
    part = identify(scan(respond(run.window()), hypotheses)[0]).largest
    assert abs(part.size - 1.07) < 3.0 * part.std < 0.03
    drifting = spoilt(planar(), {2: ramp(0.5)}, readings=42)
    hypotheses = [Hypothesis(Kind.DRIFT, ((Suspect(2, 0, False),),))]
    part = identify(scan(drifting, hypotheses)[0]).largest
    assert abs(part.size - 0.5) < 3.0 * part.std < 0.4
