"""Evidence gathered after a verdict: what a sensor that is out says, heard as a filter would that uses it."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.faults.ground import ground_of, information
from fusiond.faults.hearing import KINDS, begin, evidence_dtype, hear
from fusiond.faults.hypotheses import catalogue
from fusiond.faults.refining import account, accounts, best_of_kinds, settle_kind
from fusiond.faults.response import respond
from fusiond.faults.window import LOOKED, believed
from fusiond.types import NANOSECONDS, Kind
from tests.scenarios.faults.drive import scene

SENSOR, FIRST_S, SECONDS = "y3", 1.0, 6.0


def heard(window, number, *, from_ns=0):
    """Evidence about a sensor from all of a window."""
    layout = scene("three_positions").layout
    evidence = np.zeros(1, evidence_dtype(errors=layout.shape.errors, payload=layout.shape.payload))
    begin(evidence, from_ns, from_ns)
    hear(evidence, window, number, np.full(layout.shape.payload, 0.1), int(window["t_ns"][-1]))
    return evidence[0]


def drive(log, out=None):
    """Window and primary filter (x, P) after a log; `out`: the sensor that is excluded all the while."""
    engine = scene("three_positions").engine
    engine.reset()
    if out is not None:
        engine.track[0]["reaction"]["excluded"][out] = 1
    engine.process(log)
    return engine.window, engine.track[0]["x"][0].copy(), engine.covariance()


@pytest.fixture(scope="module")
def runs():
    """One log through the filter that uses the sensor, that only looks at it, and that never has its readings."""
    plan = scene("three_positions")
    number, log = plan.layout.numbers[SENSOR], plan.clean(SECONDS, 1)
    return number, drive(log), drive(log, number), drive(log[log["sensor"] != number])


def test_what_is_heard_again_is_what_a_filter_with_the_sensor_would_have_seen(runs):
    """Sums of w w' and w e, what separates the two estimates, and P - G: as of the filter that uses the sensor."""
    number, (used, x, P), (looked, x_without, P_without), _ = runs
    assert np.all(looked["used"][looked["sensor"] == number] == LOOKED)
    direct, again = heard(used, number), heard(looked, number)
    constant = np.arange(
        2 * scene("three_positions").layout.shape.payload
    )  # bias and drift: no prediction in them
    assert again["readings"] == direct["readings"] > 20
    np.testing.assert_allclose(again["information"][np.ix_(constant, constant)],
                               direct["information"][np.ix_(constant, constant)], rtol=1e-9)  # fmt: skip
    np.testing.assert_allclose(again["matched"][constant], direct["matched"][constant], rtol=1e-8)
    np.testing.assert_allclose(x_without + again["shift"], x, atol=1e-9)
    np.testing.assert_allclose(P_without - again["gap"], P, atol=1e-12)
    assert np.all(direct["gap"] == 0.0)


def test_without_its_looks_the_window_is_that_of_a_run_that_never_had_the_sensor(runs):
    """Innovations, gains and joined intervals alike."""
    _, _, (looked, _, _), (never, _, _) = runs
    kept, places = believed(looked)
    assert len(kept) == len(never) < len(looked)
    assert np.all(looked["used"][places] != LOOKED)
    for field in ("t_ns", "sensor", "used"):
        np.testing.assert_array_equal(kept[field], never[field])
    for field in ("e", "root", "H", "K", "T", "B"):
        np.testing.assert_allclose(kept[field][1:], never[field][1:], rtol=1e-9, atol=1e-9)


def test_with_its_onset_known_it_is_the_evidence_of_the_likelihood_ratio(runs):
    """a and b of every lasting hypothesis, as the window's own scan has them at that onset."""
    number, (used, _, _), _, _ = runs
    window = used[-90:]
    response = respond(window)
    ground = ground_of(response, (number,))
    at = len(ground.entries) // 3
    evidence = heard(window, number, from_ns=int(window["t_ns"][ground.entries[at]]) - 1)
    tried = [one for one in catalogue({number: 1}) if one.kind in KINDS]
    assert {one.kind for one in tried} == set(KINDS)
    for hypothesis in tried:
        a, b = information(ground, hypothesis)
        column = KINDS.index(hypothesis.kind) * scene("three_positions").layout.shape.payload
        slack = (
            1e-7 if hypothesis.kind is Kind.DRIFT else 1e-9
        )  # the onset lies a nanosecond before the reading
        assert evidence["information"][column, column] == pytest.approx(a[at, 0, 0], rel=slack)
        assert evidence["matched"][column] == pytest.approx(b[at, 0], rel=slack, abs=1e-9)


def test_what_was_taken_off_is_put_back_before_it_is_weighed(runs):
    """A bias found in readings that have had 0.2 taken off is 0.2 larger."""
    number, (used, _, _), _, _ = runs
    evidence = heard(used, number).reshape(1)
    bias = next(one for one in catalogue({number: 1}) if one.kind is Kind.BIAS)
    taken = np.zeros(len(evidence[0]["power"]))
    taken[0] = 0.2
    plain, more = account(evidence, bias), account(evidence, bias, taken)
    assert more.sizes[0] - plain.sizes[0] == pytest.approx(0.2)
    assert more.covariance[0, 0] == plain.covariance[0, 0]


def test_the_known_kind_stays_until_another_has_parted_from_it(runs):
    """Of a scale on a state that grows steadily the drift is as likely: whichever was named first stays."""
    number, (used, _, _), _, _ = runs
    evidence = heard(used, number).reshape(1)
    evidence["matched"] += 0.5 * evidence[0]["information"][KINDS.index(Kind.BIAS)]
    found = accounts(evidence, catalogue({number: 1}), number)
    best = best_of_kinds(found)
    assert settle_kind(found, best[0].kind).kind is best[0].kind
    assert settle_kind([], Kind.BIAS) is None
    second = best[1]
    parted = best[0].score - second.score > 2.0
    assert (settle_kind(found, second.kind).kind is second.kind) is not parted


def test_stamps_beyond_the_horizon_wait(runs):
    """What is heard in two goes, up to a stamp and then the rest, is what is heard at once."""
    number, _, (looked, _, _), _ = runs
    layout = scene("three_positions").layout
    evidence = np.zeros(1, evidence_dtype(errors=layout.shape.errors, payload=layout.shape.payload))
    begin(evidence, 0, 0)
    for until_ns in (round(FIRST_S * NANOSECONDS), int(looked["t_ns"][-1])):
        hear(evidence, looked, number, np.full(layout.shape.payload, 0.1), until_ns)
        assert evidence[0]["heard_ns"] <= until_ns
    assert evidence[0].tobytes() == heard(looked, number).tobytes()
