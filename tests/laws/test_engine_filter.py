"""The engine as a filter: FilterPy, stacked updates, the leave-one-out bank, rednose's oracle, interpreted Python."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
from filterpy.kalman import KalmanFilter

from fusiond.engine.layout import FilterLayout
from fusiond.types import Verdict
from tests.laws import engine_rig
from tests.laws.engine_rig import INPUT_STD, MS, SECOND, STD, filters, one, reading, rig, stream

A, B, G, Q = (np.array(M) for M in (engine_rig.A, engine_rig.B, engine_rig.G, engine_rig.Q))
H = {name: np.array(rows) for name, rows in engine_rig.H.items()}


def discretised(dt_s):
    """F, B and Q over an interval, by scipy."""
    F = scipy.linalg.expm(np.block([[A, B], [np.zeros((1, 3))]]) * dt_s)
    block = scipy.linalg.expm(np.block([[-A, G @ Q @ G.T], [np.zeros((2, 2)), A.T]]) * dt_s)
    return F[:2, :2], F[:2, 2:], F[:2, :2] @ block[:2, 2:]


def oracle_run(layout, readings, noise=None):
    """FilterPy over the readings of the rig, an input held until the next; returns the final filter."""
    kf = KalmanFilter(dim_x=2, dim_z=2)
    kf.x, kf.P = np.zeros((2, 1)), np.diag([4.0, 1.0])
    u, u_var, t_ns = 0.0, 0.0, int(readings[0]["t_ns"])
    for record in sorted(readings, key=lambda record: (record["t_ns"], record["sensor"], *record["z"])):
        name = layout.sensors[record["sensor"]].name
        F, B_d, Q_d = discretised((int(record["t_ns"]) - t_ns) * 1e-9)
        t_ns = int(record["t_ns"])
        kf.x, kf.P = F @ kf.x + B_d * u, F @ kf.P @ F.T + Q_d + u_var * B_d @ B_d.T
        if name == "drive":
            u, u_var = record["z"][0], INPUT_STD**2
            continue
        R = noise[name] if noise and name in noise else np.diag(np.square(STD[name]))
        rows = H[name]
        S = rows @ kf.P @ rows.T + R
        K = np.linalg.solve(S, rows @ kf.P).T
        kf.update(record["z"][: len(rows)].reshape(-1, 1), R=R, H=rows)
        assert pytest.approx(K, abs=1e-9) == kf.K
    return kf


@pytest.mark.parametrize("seed", range(3))
def test_the_engine_equals_filterpy(seed):
    """Three sensors and an input at irregular stamps, several at once: one reading after the other equals stacked."""
    engine = rig()
    readings = stream(engine.layout, 150, seed)
    engine.process(readings)
    kf = oracle_run(engine.layout, readings)
    assert engine.track[0]["x"][0] == pytest.approx(kf.x[:, 0], abs=1e-9)
    assert engine.covariance() == pytest.approx(kf.P, abs=1e-9)


def test_a_covariance_is_kept_for_each_reading_where_asked():
    engine = rig()
    readings = stream(engine.layout, 20, 4)
    engine.process(readings, covariances=True)
    kept = engine.covariances[:20].copy()
    engine.reset()
    for record, P in zip(readings, kept, strict=True):
        report = engine.process(record[None])[0]
        assert np.array_equal(engine.covariance(), P)
        assert report["std"] == pytest.approx(np.sqrt(np.diag(P)), rel=1e-12)


CORRELATED = np.array([[0.09, 0.12], [0.12, 0.25]])


def test_a_correlated_noise_equals_a_stacked_update():
    """noise_covariance in the configuration, and the same R carried by each reading."""
    configured = rig(sensors={"a": {"noise_std": "{}", "noise_covariance": CORRELATED.tolist()}})
    carried = rig()
    readings = stream(configured.layout, 100, 7)
    with_R = readings.copy()
    of_a = readings["sensor"] == configured.layout.numbers["a"]
    with_R["R"][of_a] = CORRELATED
    with_R["flags"][of_a] |= 2
    configured.process(readings)
    reports = carried.process(with_R)
    kf = oracle_run(configured.layout, readings, {"a": CORRELATED})
    for engine in (configured, carried):
        assert engine.track[0]["x"][0] == pytest.approx(kf.x[:, 0], abs=1e-9)
        assert engine.covariance() == pytest.approx(kf.P, abs=1e-9)
    assert reports["R_used"][of_a] == pytest.approx(np.broadcast_to([0.09, 0.25], (of_a.sum(), 2)))


def test_the_report_describes_the_innovation_before_the_update():
    """nu, the diagonals of S and R, and nis = nu' S^-1 nu with the full S; e is its whitened form."""
    engine = rig(sensors={"b": {"noise_std": "{}", "noise_covariance": CORRELATED.tolist()}})
    seen = 0
    for record in stream(engine.layout, 40, 3, distinct=True):
        x, P = engine.track[0]["x"][0].copy(), engine.covariance()
        before_ns = int(engine.track[0]["filter_t_ns"][0])
        report = engine.process(record[None])[0].copy()
        if engine.layout.sensors[record["sensor"]].name != "b" or before_ns == 0:
            continue
        seen += 1
        F, B_d, Q_d = discretised((int(record["t_ns"]) - before_ns) * 1e-9)
        u, u_var = engine.track[0]["u"][0], engine.track[0]["u_var"][0]
        P = F @ P @ F.T + Q_d + u_var * B_d @ B_d.T
        nu = record["z"] - H["b"] @ (F @ x + B_d[:, 0] * u)
        S = H["b"] @ P @ H["b"].T + CORRELATED
        assert report["dof"] == 2
        assert report["nu"] == pytest.approx(nu, abs=1e-10)
        assert report["S"] == pytest.approx(np.diag(S), rel=1e-9)
        assert report["nis"] == pytest.approx(nu @ np.linalg.solve(S, nu), rel=1e-8)
        assert report["nis"] == pytest.approx(report["e"] @ report["e"], rel=1e-12)
    assert seen >= 5


@pytest.mark.parametrize("left_out", ["a", "b", "c"])
def test_leaving_a_sensor_out_is_never_having_had_it(left_out):
    """Bit for bit: the bank's filter, and the centralized one of a configuration without that sensor."""
    whole, without = rig(), rig(without=(left_out,))
    readings = stream(whole.layout, 300, 11)
    whole.process(readings)
    for record in readings:
        name = whole.layout.sensors[record["sensor"]].name
        if name != left_out:
            length = record["length"]
            without.process(reading(without.layout, name, int(record["t_ns"]), record["z"][:length]))
    row = whole.layout.filters.index(FilterLayout("without", left_out))
    kept, alone = filters(whole), filters(without)
    upper = np.triu_indices(2, 1)
    assert row > 0
    assert np.array_equal(kept["x"][row], alone["x"][0])
    assert np.array_equal(kept["d"][row], alone["d"][0])
    assert np.array_equal(kept["U"][row][upper], alone["U"][0][upper])
    assert kept["filter_t_ns"][row] == alone["filter_t_ns"][0]
    assert not np.array_equal(kept["x"][0], kept["x"][row])


def test_rednoses_oracle_to_its_printed_digits():
    """commaai/rednose, examples/test_kinematic_kf.py: 500 positions of a point whose speed is sin 5t, noise 0.1.

    x0 = [0.5, 0], P0 = I, Q = diag(0.1^2, 2^2) dt, no prediction before the first update.
    """
    engine = rig(
        model={
            "A": [[1.0, 0.01], [0.0, 1.0]],
            "B": [[0.0], [0.0]],
            "Q": [[1e-4, 0.0], [0.0, 0.04]],
            "step_s": 0.01,
        },
    )
    engine._design[0]["x0"] = [0.5, 0.0]
    engine._design[0]["d0"] = [1.0, 1.0]
    rng = np.random.RandomState(0)  # the oracle's own generator
    x, records = 0.0, []
    for k, v in enumerate(np.sin(np.arange(0, 5, step=0.01) * 5)):
        records.append(reading(engine.layout, "c", SECOND + k * 10 * MS, rng.normal(x, 0.1)))
        x += v * 0.01
    report = engine.process(np.concatenate(records))[-1]
    assert report["verdict"] == Verdict.USED
    assert report["x"] == pytest.approx([-0.010866289677966417, -0.8553720537261753], rel=1e-12)
    assert report["std"] == pytest.approx([0.04477103863330089, 0.6695762270974388], rel=1e-12)


COMPARED = """
import sys
import numpy as np
from tests.laws.engine_rig import rig, stream
engine = rig()
reports = engine.process(stream(engine.layout, 60, 21)[np.random.default_rng(2).permutation(60)])
track = engine.track[0]
np.savez(sys.argv[1], verdict=reports["verdict"], x=reports["x"], std=reports["std"], nis=reports["nis"],
         command=reports["command"], action=reports["action"], bank=track["x"], d=track["d"])
"""


def test_compiled_equals_interpreted(tmp_path):
    """The whole step, late readings included, with and without numba: to 1e-12."""
    results = []
    for name, disable in (("compiled", "0"), ("interpreted", "1")):
        out = tmp_path / f"{name}.npz"
        environment = {**os.environ, "NUMBA_DISABLE_JIT": disable, "PYTHONPATH": str(Path.cwd())}
        subprocess.run([sys.executable, "-c", COMPARED, str(out)], env=environment, check=True, timeout=280)
        results.append(np.load(out))
    compiled, plain = results
    assert (compiled["verdict"] == Verdict.USED).any()
    assert compiled["action"].any()
    for name in compiled.files:
        assert compiled[name] == pytest.approx(plain[name], rel=1e-12, abs=1e-12), name


def test_a_perfect_sensor_is_believed_and_its_echo_changes_nothing():
    """noise_std 0, the same reading twice: S = 0 the second time, the state stays finite and exact."""
    engine = rig(sensors={"c": {"noise_std": "{ z0 = 0.0 }"}})
    first = one(engine, "c", SECOND, [0.7], seq=1)
    second = one(engine, "c", SECOND, [0.7], seq=2)
    assert first["x"][0] == pytest.approx(0.7, abs=1e-15)
    assert second["verdict"] == Verdict.USED
    assert np.array_equal(second["x"], first["x"])
    assert second["nis"] == 0.0
    assert second["std"][0] == 0.0
