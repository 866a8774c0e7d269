"""The door: each refusal by its name, from both sides of its limit, and nothing touched by what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fusiond.types import Verdict
from tests.laws.engine_rig import MS, SECOND, one, reading, rig, stream

LIMITED = {"a": {"valid": "{ z0 = [-2.0, 3.0] }"}}
VALUES = {
    "a nan": (("a", [math.nan, 0.0]), Verdict.NON_FINITE),
    "an infinity in the last channel": (("a", [0.0, math.inf]), Verdict.NON_FINITE),
    "an infinite input": (("drive", [-math.inf]), Verdict.NON_FINITE),
    "one number too few": (("a", [0.0]), Verdict.WRONG_LENGTH),
    "one number too many": (("c", [0.0, 0.0]), Verdict.WRONG_LENGTH),
    "more numbers than any reading holds": (("a", [0.0] * 9), Verdict.WRONG_LENGTH),
    "none at all": (("c", []), Verdict.WRONG_LENGTH),
    "a hair above its range": (("a", [math.nextafter(3.0, 4.0), 0.0]), Verdict.OUT_OF_RANGE),
    "a hair below its range": (("a", [math.nextafter(-2.0, -3.0), 0.0]), Verdict.OUT_OF_RANGE),
    "the top of its range": (("a", [3.0, 1e6]), Verdict.USED),
    "more digits than any instrument has": (("a", [0.0, 1e12]), Verdict.OUT_OF_RANGE),
    "the bottom of its range": (("a", [-2.0, -1e6]), Verdict.USED),
}
COVARIANCES = {
    "a negative variance": ([[-0.1, 0.0], [0.0, 1.0]], Verdict.BAD_COVARIANCE),
    "a nan": ([[math.nan, 0.0], [0.0, 1.0]], Verdict.BAD_COVARIANCE),
    "an infinite variance": ([[math.inf, 0.0], [0.0, 1.0]], Verdict.BAD_COVARIANCE),
    "a nan beside the diagonal": ([[1.0, math.nan], [math.nan, 1.0]], Verdict.BAD_COVARIANCE),
    "a skew pair": ([[1.0, 0.2], [0.1, 1.0]], Verdict.BAD_COVARIANCE),
    "a correlation above one": ([[1.0, 1.01], [1.01, 1.0]], Verdict.BAD_COVARIANCE),
    "a correlation of a perfect channel": ([[0.0, 0.1], [0.1, 1.0]], Verdict.BAD_COVARIANCE),
    "a correlation of one": ([[1.0, 1.0], [1.0, 1.0]], Verdict.USED),
    "zeros": ([[0.0, 0.0], [0.0, 0.0]], Verdict.USED),
    "the largest double": ([[1.7e308, 0.0], [0.0, 1.7e308]], Verdict.USED),
}


@pytest.fixture(scope="module")
def engine():
    return rig(sensors=LIMITED)


@pytest.fixture
def warm(engine):
    """The engine after some sound readings, at 2 s."""
    engine.reset()
    engine.process(stream(engine.layout, 30, 1))
    one(engine, "c", 2 * SECOND, [0.1])
    return engine


@pytest.mark.parametrize("case", VALUES)
def test_numbers_are_judged(warm, case):
    said, verdict = VALUES[case]
    before = warm.track.tobytes(), warm.desk.tobytes()
    report = one(warm, said[0], 2 * SECOND + MS, said[1])
    assert report["verdict"] == verdict
    assert report["length"] == len(said[1])
    assert np.isfinite(report["x"]).all()
    if verdict != Verdict.USED:
        assert (warm.track.tobytes(), warm.desk.tobytes()) == before


@pytest.mark.parametrize("case", COVARIANCES)
def test_a_covariance_that_comes_with_a_reading_is_judged(warm, case):
    R, verdict = COVARIANCES[case]
    before = warm.track.tobytes()
    report = one(warm, "a", 2 * SECOND + MS, [0.0, 0.0], R=R)
    assert report["verdict"] == verdict
    assert np.isfinite(report["x"]).all()
    assert np.isfinite(report["std"]).all()
    if verdict != Verdict.USED:
        assert warm.track.tobytes() == before


@pytest.mark.parametrize(("variance", "verdict"), [(0.04, Verdict.USED), (-0.04, Verdict.BAD_COVARIANCE)])
def test_the_variance_that_comes_with_an_input_drives_the_prediction(warm, variance, verdict):
    report = one(warm, "drive", 2 * SECOND + MS, [1.0], R=[[variance]])
    assert report["verdict"] == verdict
    assert (warm.track[0]["u_var"][0] == variance) == (verdict == Verdict.USED)


@pytest.mark.parametrize("number", [-3, 99, 2**31 - 1, -(2**31)])
def test_a_number_nobody_has_is_an_unknown_sensor(warm, number):
    record = reading(warm.layout, "a", 2 * SECOND + MS, [0.0, 0.0])
    record["sensor"] = number
    before = warm.track.tobytes()
    assert warm.process(record)["verdict"][0] == Verdict.UNKNOWN_SENSOR
    assert warm.track.tobytes() == before


@pytest.mark.parametrize(
    ("sent", "kept"),
    [
        ([5, 6, 7], [5, 6, 7]),
        ([5, 5], [5]),
        ([5, 7, 6, 7, 6], [5, 7, 6]),
        ([100, 163, 100], [100, 163]),
        ([100, 37, 37], [100, 37]),
        ([100, 150, 100, 150, 151], [100, 150, 151]),
        ([1, 200, 300, 300], [1, 200, 300]),
        ([2**64 - 2, 2**64 - 1, 2**64 - 1], [2**64 - 2, 2**64 - 1]),
    ],
    ids=str,
)
@pytest.mark.parametrize("refused", [Verdict.DUPLICATE, Verdict.CONFLICT])
def test_a_repeated_sequence_number_is_refused(warm, sent, kept, refused):
    """As a duplicate, or as a conflict with other stamp and numbers; a number that was skipped may still come."""
    used = []
    for k, seq in enumerate(sent):
        same = sent.index(seq) if refused is Verdict.DUPLICATE else k
        report = one(warm, "c", 2 * SECOND + (same + 1) * MS, [float(same)], seq=seq)
        if report["verdict"] == Verdict.USED:
            used.append(seq)
        else:
            assert report["verdict"] == refused
    assert used == kept


def test_sequence_numbers_of_one_sensor_are_nothing_to_another(warm):
    assert one(warm, "c", 2 * SECOND + MS, [0.0], seq=5)["verdict"] == Verdict.USED
    assert one(warm, "drive", 2 * SECOND + MS, [0.0], seq=5)["verdict"] == Verdict.USED


@pytest.mark.parametrize("sent_before", [3, 40, 500])
def test_a_sensor_that_starts_anew_is_heard(warm, sent_before):
    """Its numbers begin at 0 again, with stamps that go on; then all of them are fresh."""
    for k in range(sent_before):
        one(warm, "c", 2 * SECOND + (k + 1) * MS, [0.0], seq=k)
    after = 2 * SECOND + (sent_before + 1) * MS
    verdicts = [one(warm, "c", after + k * MS, [0.0], seq=k)["verdict"] for k in range(sent_before + 5)]
    assert set(verdicts) == {Verdict.USED}


def test_a_refused_reading_does_not_use_up_its_number(warm):
    assert one(warm, "a", 2 * SECOND + MS, [math.nan, 0.0], seq=8)["verdict"] == Verdict.NON_FINITE
    assert one(warm, "a", 2 * SECOND - 2 * SECOND, [0.0, 0.0], seq=8)["verdict"] == Verdict.TOO_LATE
    assert one(warm, "a", 2 * SECOND + MS, [0.0, 0.0], seq=8)["verdict"] == Verdict.USED


def test_a_repeated_value_of_a_sensor_that_holds_its_last_fix_is_no_evidence():
    """`repeats = "held"`: told held, the filter stays, the sensor counts as alive; a changed value is used again."""
    engine = rig(sensors={"a": {"repeats": '"held"', "max_silence_s": 0.5}})
    assert one(engine, "a", SECOND, [1.0, 2.0])["verdict"] == Verdict.USED
    before = engine.track[0]["x"].copy(), engine.track[0]["d"].copy()
    held = one(engine, "a", SECOND + 400 * MS, [1.0, 2.0])
    assert held["verdict"] == Verdict.HELD
    assert np.array_equal(engine.track[0]["x"], before[0])
    assert np.array_equal(engine.track[0]["d"], before[1])
    assert engine.track[0]["update_ns"] == SECOND
    assert one(engine, "a", SECOND + 800 * MS, [1.0, math.nextafter(2.0, 3.0)])["verdict"] == Verdict.USED


def test_a_repeated_value_is_fresh_evidence_unless_said_otherwise(warm):
    assert one(warm, "c", 2 * SECOND + MS, [0.1])["verdict"] == Verdict.USED


def test_what_is_held_is_judged_in_the_order_of_stamps():
    """The repetition that arrives first is used once the original turns up behind it."""
    engine = rig(sensors={"a": {"repeats": '"held"'}})
    for k, values in enumerate(([1.0, 2.0], [1.0, 2.0], [3.0, 4.0])):
        one(engine, "a", SECOND + k * 100 * MS, values)
    ordered = engine.state_sha256()
    engine.reset()
    for k, values in ((2, [3.0, 4.0]), (1, [1.0, 2.0]), (0, [1.0, 2.0])):
        one(engine, "a", SECOND + k * 100 * MS, values)
    assert engine.state_sha256() == ordered


def test_no_gate_is_an_infinite_limit():
    engine = rig()
    assert np.isinf(one(engine, "a", SECOND, [0.1, 0.2])["limit"])
