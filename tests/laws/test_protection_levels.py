"""The levels in the reports are those of the pure function, on the bank's rows brought to one time."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from fusiond.assembly.assembly import Assembly, assemble
from fusiond.config import parse
from fusiond.engine.engine import Engine
from fusiond.errors import ConfigError
from fusiond.faults.protection import protection_levels
from fusiond.recording.views import estimate_message
from fusiond.service.messages import EstimateMessage, dumps
from fusiond.service.report_rows import ReportRows
from tests.laws.engine_rig import INPUT_STD, MS, A, B, G, Q, assembled, one, reading, tick, toml_of

OUTSIDE = 1e-3
PROTECT = f'[faults]\nprotect = ["velocity", "position"]\nprotect_outside = {OUTSIDE}\n'
ROWS = (1, 2, 3)
"""Filters of the rig that leave one sensor out."""
Matrix = NDArray[np.float64]


def guarded() -> Assembly:
    return assembled(toml_of(sections=PROTECT))


def later(x: Matrix, P: Matrix, u: float, dt_s: float) -> tuple[Matrix, Matrix]:
    """x and P after dt_s, by matrix exponentials of augmented systems (Van Loan)."""
    a, b, g = np.array(A), np.array(B), np.array(G)
    driven = expm(np.block([[a, b], [np.zeros((1, 3))]]) * dt_s)
    F, Bd = driven[:2, :2], driven[:2, 2:]
    both = expm(np.block([[-a, g @ np.array(Q) @ g.T], [np.zeros((2, 2)), a.T]]) * dt_s)
    noise = both[2:, 2:].T @ both[:2, 2:]
    return F @ x + Bd[:, 0] * u, F @ P @ F.T + noise + INPUT_STD**2 * Bd @ Bd.T


def expected(engine: Engine, t_ns: int) -> Matrix:
    """Levels of position and velocity at t_ns from the rows of the engine's bank, each from its own time."""
    track = engine.track[0]
    rows = []
    for row in (0, *ROWS):
        U = np.triu(np.array(track["U"][row]))
        np.fill_diagonal(U, 1.0)
        P = U @ np.diag(track["d"][row]) @ U.T
        dt_s = (t_ns - int(track["filter_t_ns"][row])) * 1e-9
        rows.append(later(np.array(track["x"][row]), P, float(track["u"][0]), dt_s))
    apart = np.array([rows[0][0] - x for x, _ in rows[1:]])
    return protection_levels(OUTSIDE, np.eye(2), rows[0][1], apart, np.array([P for _, P in rows[1:]]))


def travel(engine: Engine, steps: int) -> list[tuple[Any, Matrix]]:
    """Readings of sensors out of step with each other; the report on each and the levels that it should show."""
    rng, seen = np.random.default_rng(3), []
    for k in range(steps):
        sensor = ("drive", "a", "b", "c", "b")[int(rng.integers(5))]
        t_ns = (k + 1) * 37 * MS
        z = rng.standard_normal({"drive": 1, "c": 1}.get(sensor, 2))
        report = one(engine, sensor, t_ns, z)
        seen.append((report, expected(engine, int(report["state_t_ns"]))))
    return seen


def test_levels_are_those_of_the_pure_function_although_filters_lag() -> None:
    engine = guarded().engine()
    seen = travel(engine, 60)
    for report, levels in seen:
        assert report["protection"] == pytest.approx(levels[[1, 0]], rel=1e-9)
    times = engine.track[0]["filter_t_ns"][list(ROWS)]
    assert len(set(times.tolist())) > 1


def test_a_tick_carries_them_to_its_time_and_leaves_the_track_alone() -> None:
    engine = guarded().engine()
    travel(engine, 20)
    before = engine.track.tobytes()
    t_ns = int(engine.track[0]["t_ns"]) + 250 * MS
    report = engine.process(tick(engine.layout, t_ns))[0].copy()
    assert report["protection"] == pytest.approx(expected(engine, t_ns)[[1, 0]], rel=1e-9)
    assert engine.track.tobytes() == before


def test_nothing_else_depends_on_whether_they_are_asked_for() -> None:
    engine, plain = guarded().engine(), assembled(toml_of(sections="[faults]\n")).engine()
    for (report, _), (other, _) in zip(travel(engine, 60), travel(plain, 60), strict=True):
        assert all(report[name].tobytes() == other[name].tobytes() for name in other.dtype.names)
    assert engine.track.tobytes() == plain.track.tobytes()


def test_separations_of_angles_are_taken_on_the_circle() -> None:
    """The state lies at the seam, the filters on both sides of it: levels stay far below a full turn."""
    whole = guarded()
    design = whole.design.copy()
    design[0]["angle"][0] = 1
    design[0]["wraps"][:, 0] = 1
    engine = dataclasses.replace(whole, design=design).engine()
    for k in range(1, 40):
        for sensor, z in (("a", [3.0, 0.0]), ("c", [-3.0])):
            report = one(engine, sensor, k * 20 * MS, z)
    x = engine.track[0]["x"][[0, *ROWS], 0]
    assert np.ptp(x) > np.pi
    assert report["protection"][1] < 2.0


def test_messages_name_them_and_say_null_where_nothing_is_known() -> None:
    whole = guarded()
    engine = whole.engine()
    blank = engine.process(tick(engine.layout, MS)).copy()
    assert np.isinf(blank["protection"]).all()
    unknown = {"velocity": None, "position": None}
    assert estimate_message(engine.layout, blank[0], 0, "")["protection"] == unknown
    reports = engine.process(reading(engine.layout, "a", 2 * MS, [1.0, 0.0])).copy()
    rows, raw = ReportRows(engine.layout), reports.tobytes()
    x, std, resets, jump, unobserved = rows.state(raw, 0)
    message = EstimateMessage(engine.layout).content(
        0, 1, 1, resets, jump, x, std, 0, None, rows.protection(raw, 0), unobserved
    )
    named = dict(zip(("velocity", "position"), reports["protection"][0].tolist(), strict=True))
    assert message["protection"] == named == estimate_message(engine.layout, reports[0], 0, "")["protection"]
    assert b"protection" in dumps(message)


@pytest.mark.parametrize(
    ("sections", "without", "said"),
    [
        ('[faults]\nprotect = ["height"]\n', (), "no state `height`"),
        ('[faults]\nprotect = ["position", "position"]\n', (), "twice"),
        ('[faults]\nprotect = ["position"]\n', ("b", "c"), "only one sensor"),
        ('[faults]\nprotect = ["position"]\n[filter]\nleave_one_out = false\n', (), "leave_one_out"),
    ],
)
def test_what_cannot_be_promised_is_refused(sections: str, without: tuple[str, ...], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        assemble(parse(toml_of(sections=sections, without=without), "rig"))
