from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusiond.errors import LogError
from fusiond.recording.truth import read_truth, wrapped


@pytest.fixture
def truth_of(tmp_path):
    def make(text: str, angles: tuple[str, ...] = ("yaw",)):
        (tmp_path / "truth.csv").write_text(text)
        return read_truth(tmp_path / "truth.csv", angles)

    return make


def test_values_are_interpolated_and_angles_take_the_short_way(truth_of):
    truth = truth_of("t_s,x,yaw\n1,0,3.0\n2,10,-3.0\n4,10,-3.0\n")
    t_ns = np.array([1_500_000_000, 3_000_000_000, 4_000_000_000, 4_000_000_001, 999_999_999])
    values, covered = truth.at(t_ns)
    assert values[0, 0] == pytest.approx(5.0)
    assert abs(values[0, 1]) == pytest.approx(np.pi)
    assert values[1].tolist() == pytest.approx([10.0, -3.0])
    assert covered.tolist() == [True, True, True, False, False]


def test_angle_errors_are_on_the_circle(truth_of):
    truth = truth_of("t_s,x,yaw\n0,0,3.1\n1,0,3.1\n")
    errors = truth.errors(np.array([[7.0, -3.1]]), np.array([[0.0, 3.1]]))
    assert errors[0].tolist() == pytest.approx([7.0, 2 * np.pi - 6.2])


def test_epoch_times_keep_their_nanoseconds(truth_of):
    truth = truth_of("t_s,x\n1700000000.000000000,0\n1700000000.000000010,10\n")
    values, _ = truth.at(np.array([1_700_000_000_000_000_003]))
    assert values[0, 0] == pytest.approx(3.0)


@given(
    st.lists(st.integers(0, 1000), min_size=2, max_size=40, unique=True),
    st.lists(st.integers(-10, 1010), max_size=9),
)
def test_looking_at_a_part_gives_what_the_whole_gives(tmp_path_factory, times, asked):
    times = sorted(times)
    path = tmp_path_factory.mktemp("truth") / "truth.csv"
    path.write_text("t_s,x\n" + "".join(f"{t}e-3,{t * t % 97}\n" for t in times))
    truth = read_truth(path, ())
    t_ns = np.array(asked, dtype=np.int64) * 1_000_000
    expected = np.interp(asked, times, [t * t % 97 for t in times])
    assert truth.at(t_ns)[0][:, 0] == pytest.approx(expected, abs=1e-9)


@given(st.floats(-100, 100))
def test_wrapping_keeps_the_direction(angle):
    once = wrapped(np.array([angle]))
    assert -np.pi <= once[0] <= np.pi
    assert np.cos(once[0]) == pytest.approx(np.cos(angle), abs=1e-12)
    assert np.sin(once[0]) == pytest.approx(np.sin(angle), abs=1e-12)


@pytest.mark.parametrize(
    ("text", "fact"),
    [
        ("", "no truth file"),
        ("time,x\n1,2\n", "no truth file"),
        ("t_s,x,x\n1,2,3\n", "each once"),
        ("t_s,x\n", "no rows"),
        ("t_s,x\n1\n", "numbers"),
        ("t_s,x\n1,nan\n", "finite"),
        ("t_s,x\n1,2\n2,2\n1.5,2\n", "line 4 is earlier"),
    ],
)
def test_what_is_no_truth_is_an_error(truth_of, text, fact):
    with pytest.raises(LogError, match=fact):
        truth_of(text)
