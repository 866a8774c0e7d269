"""The law of each kind of fault, and of several together."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusiond.simulation.faults import Kind, parse_fault, parse_faults
from fusiond.simulation.faults_delay import wrapped
from fusiond.simulation.faults_injection import Injection, Measured, SensorFaults

MS = 1_000_000
T_NS = np.arange(0, 20_000, 100, dtype=np.int64) * MS
"""Every 0.1 s for 20 s, beginning at a stamp that is not zero."""
START_NS = 1_700_000_000_000_000_000
T_NS = T_NS + START_NS
T_S = (T_NS - START_NS) / 1e9
SIGMA = (0.5, 0.25)
RNG = np.random.default_rng(7)
Z = np.column_stack([np.sin(T_S), 3.0 * T_S]) + RNG.normal(size=(len(T_NS), 2)) * SIGMA


def sensor(**changes) -> Measured:
    return Measured(**{"name": "s", "channels": 2, "sigma": SIGMA} | changes)


def lying(*texts: str, seed: int = 0, **changes) -> SensorFaults:
    return SensorFaults(sensor(**changes), parse_faults(texts), seed, None)


def sent(*texts: str, z=Z, t_ns=T_NS, seed: int = 0, sigma=None, **changes):
    before = z.tobytes()
    out = lying(*texts, seed=seed, **changes).apply(t_ns, z, sigma)
    assert z.tobytes() == before, "what was handed in was altered"
    return out


def inside(start_s: float, end_s: float = np.inf):
    return np.array([start_s <= t_s < end_s for t_s in T_S.tolist()])


# each kind


def test_a_bias_is_added_from_start_to_the_end_of_duration():
    z, keep = sent("s.1.bias=0.5@10+5")
    on = inside(10.0, 15.0)
    assert keep.all()
    assert np.array_equal(z[on, 1], Z[on, 1] + 0.5)
    assert z[~on].tobytes() == Z[~on].tobytes()
    assert z[:, 0].tobytes() == Z[:, 0].tobytes()


def test_without_a_channel_a_fault_is_in_every_measured_one_and_not_in_the_index():
    z, _ = sent("s.bias=2@0", measured=1, sigma=(0.5,))
    assert np.array_equal(z[:, 0], Z[:, 0] + 2.0)
    assert z[:, 1].tobytes() == Z[:, 1].tobytes()
    z, _ = sent("s.1.bias=2@0", measured=1, sigma=(0.5,))
    assert np.array_equal(z[:, 1], Z[:, 1] + 2.0)


def test_a_drift_grows_by_its_size_every_second():
    z, _ = sent("s.0.drift=0.02@5")
    assert np.allclose(z[:, 0] - Z[:, 0], np.where(T_S >= 5.0, 0.02 * (T_S - 5.0), 0.0), atol=1e-12)


def test_a_scale_multiplies():
    z, _ = sent("s.scale=1.07@3+2")
    assert np.array_equal(z, np.where(inside(3.0, 5.0)[:, None], 1.07 * Z, Z))


@pytest.mark.parametrize("factor", [1.5, 4.0])
def test_noise_makes_the_whole_noise_so_many_times_its_own(factor):
    """Of 40,000 readings, within 2 % (four standard deviations of the estimate) in each channel."""
    rng = np.random.default_rng(1)
    z = rng.normal(size=(40_000, 2)) * SIGMA
    t_ns = np.arange(40_000, dtype=np.int64) * MS
    noisy, _ = sent(f"s.noise={factor}@0", z=z, t_ns=t_ns)
    assert noisy.std(axis=0) == pytest.approx(factor * np.array(SIGMA), rel=0.02)
    assert abs(np.corrcoef((noisy - z).T)[0, 1]) < 0.02


def test_noise_goes_by_the_covariance_that_a_reading_brings():
    own = np.full((len(T_NS), 2), 10.0)
    own[100:] = 0.0
    z, _ = sent("s.noise=2@0", sigma=own)
    plain, _ = sent("s.noise=2@0")
    assert np.allclose((z - Z)[:100] * SIGMA / 10.0, (plain - Z)[:100], rtol=1e-6, atol=1e-9)
    assert np.array_equal(z[100:], Z[100:])


def test_a_spike_is_one_reading_unless_it_is_given_a_duration():
    z, _ = sent("s.0.spike=3@4.05")
    assert np.flatnonzero(z[:, 0] != Z[:, 0]).tolist() == [41]
    assert z[41, 0] == Z[41, 0] + 3.0
    z, _ = sent("s.0.spike=3@4.05+0.2")
    assert np.flatnonzero(z[:, 0] != Z[:, 0]).tolist() == [41, 42]


def test_a_stuck_sensor_repeats_its_last_value_and_keeps_its_stamps():
    z, keep = sent("s.stuck@10+5")
    on = inside(10.0, 15.0)
    assert keep.all()
    assert {row.tobytes() for row in z[on]} == {Z[99].tobytes()}
    assert z[~on].tobytes() == Z[~on].tobytes()


def test_a_sensor_that_is_stuck_from_the_beginning_repeats_its_first_value():
    z, _ = sent("s.stuck@0")
    assert {row.tobytes() for row in z} == {Z[0].tobytes()}


def test_nan_is_not_a_number_in_its_channel_alone():
    z, keep = sent("s.1.nan@2+1")
    assert keep.all()
    assert np.array_equal(np.isnan(z[:, 1]), inside(2.0, 3.0))
    assert not np.isnan(z[:, 0]).any()


def test_a_broken_sensor_sends_nothing():
    z, keep = sent("s.broken@10+5")
    assert np.array_equal(keep, ~inside(10.0, 15.0))
    assert z[keep].tobytes() == Z[keep].tobytes()


def test_an_intermittent_sensor_delivers_its_share():
    """A tenth of 20,000 readings, within 0.8 % (four standard deviations); none and all at its limits."""
    t_ns = np.arange(20_000, dtype=np.int64) * MS
    z = np.zeros((20_000, 2))
    assert sent("s.intermittent=0.1@0", z=z, t_ns=t_ns)[1].mean() == pytest.approx(0.1, abs=0.0085)
    assert not sent("s.intermittent=0@0", z=z, t_ns=t_ns)[1].any()
    assert sent("s.intermittent=1@0", z=z, t_ns=t_ns)[1].all()


# delay


def test_a_delayed_reading_carries_the_value_of_a_while_ago_under_its_own_stamp():
    """On a straight line interpolation is exact: 3 (t - 0.15)."""
    line = np.column_stack([3.0 * T_S, -T_S])
    z, keep = sent("s.delay=0.15@2", z=line)
    late = T_S - np.where(T_S >= 2.0, 0.15, 0.0)
    assert keep.all()
    assert np.allclose(z, np.column_stack([3.0 * late, -late]), atol=1e-12)


def test_a_delay_of_whole_periods_gives_the_very_readings():
    z, _ = sent("s.delay=0.3@0")
    assert z[3:].tobytes() == Z[:-3].tobytes()
    assert {row.tobytes() for row in z[:3]} == {Z[0].tobytes()}


def test_a_delayed_angle_takes_the_short_way_round():
    """Turning at 1 rad/s: never more than rounding off, across pi too."""
    angle = wrapped(1.0 * T_S)[:, None]
    z, _ = sent("s.delay=0.15@1", z=angle, channels=1, sigma=(0.1,), angles=frozenset({0}))
    expected = wrapped(T_S - np.where(T_S >= 1.0, 0.15, 0.0))
    assert np.abs(wrapped(z[:, 0] - expected)).max() < 1e-9
    assert np.abs(z).max() <= np.pi


def test_a_delayed_range_is_an_earlier_range_to_the_same_beacon():
    """Four beacons in turn, each range a line of its own offset: no other beacon's is mixed in."""
    index = np.arange(len(T_NS)) % 4
    ranges = np.column_stack([100.0 * index + T_S, index.astype(float)])
    z, _ = sent("s.delay=0.4@0", z=ranges, measured=1, sigma=(0.1,))
    assert np.array_equal(z[:, 1], ranges[:, 1])
    assert np.allclose(z[4:, 0], ranges[4:, 0] - 0.4, atol=1e-9)


def test_late_readings_know_only_what_came_before_them():
    """Stamps 0, 2, 1 s: the reading of 1 s, delayed by half a second, lies between those of 0 and 1."""
    t_ns = np.array([0, 2000, 1000, 3000]) * MS
    z = np.array([[0.0], [20.0], [10.0], [30.0]])
    out, _ = sent("s.delay=0.5@0", z=z, t_ns=t_ns, channels=1, sigma=(1.0,))
    assert np.allclose(out[:, 0], [0.0, 15.0, 5.0, 25.0])


# angles


def test_an_angle_stays_on_its_circle():
    z, _ = sent("s.0.bias=3@0", z=np.column_stack([T_S % 3.0, T_S]), angles=frozenset({0}))
    assert np.allclose(wrapped(z[:, 0] - T_S % 3.0 - 3.0), 0.0, atol=1e-12)
    assert z[:, 0].max() <= np.pi
    assert z[:, 0].min() > -np.pi


@given(st.lists(st.floats(-3.1, 3.1), min_size=1, max_size=5))
def test_an_angle_that_is_one_already_keeps_its_bits(angles):
    assert wrapped(np.array(angles)).tobytes() == np.array(angles).tobytes()


# several together


@pytest.mark.parametrize("order", [1, -1])
def test_several_faults_act_in_one_order_however_they_are_given(order):
    """Delay, scale, bias, then stuck: 2 z(t - 0.1) + 1, frozen at its last value before 15 s."""
    texts = ["s.delay=0.1@0", "s.scale=2@0", "s.bias=1@0", "s.stuck@15"][::order]
    z, _ = sent(*texts)
    expected = 2.0 * np.vstack([Z[:1], Z[:-1]]) + 1.0
    expected[150:] = expected[149]
    assert np.array_equal(z, expected)


def test_the_order_is_the_documented_one():
    assert [kind.value for kind in Kind] == [
        "delay", "scale", "bias", "drift", "noise", "spike", "stuck", "nan", "intermittent", "broken",
    ]  # fmt: skip


def test_start_counts_from_the_first_reading_of_any_sensor():
    injection = Injection(parse_faults(["s.bias=1@1"]), [sensor(), Measured("other", 1)])
    injection.start(START_NS - 500 * MS)
    faults = injection.of("s")
    assert faults is not None
    z, _ = faults.apply(T_NS, Z)
    assert np.flatnonzero(z[:, 0] != Z[:, 0])[0] == 5


def test_one_fault_more_changes_no_draw_of_another():
    """The noise of a sensor with other faults beside it is the same noise."""
    alone, _ = sent("s.noise=3@0")
    beside, _ = sent("s.bias=1@0", "s.noise=3@0", "s.intermittent=0.5@0")
    assert np.allclose(beside - 1.0, alone, atol=1e-12)
    two, _ = sent("s.noise=3@0", "s.noise=3@0")
    assert not np.allclose(two - Z, 2.0 * (alone - Z))


def test_a_fault_that_met_nothing_is_told():
    faults = lying("s.bias=1@5", "s.bias=1@50", "s.delay=0.1@60", "s.bias=0@0")
    faults.apply(T_NS, Z)
    assert [str(fault) for fault in faults.unmet()] == ["s.bias=1@50", "s.delay=0.1@60"]


def test_cleared_faults_are_gone_with_the_next_reading():
    faults = lying("s.bias=1@0", "s.stuck@0")
    assert not np.array_equal(faults.apply(T_NS[:9], Z[:9])[0], Z[:9])
    faults.clear()
    assert faults.apply(T_NS[9:], Z[9:])[0].tobytes() == Z[9:].tobytes()


def test_a_fault_switched_on_later_remembers_what_came_before():
    """`stuck` and `delay`, added after 50 readings, repeat and recall those."""
    faults = SensorFaults(sensor(), (), 0, None, ready=True)
    faults.apply(T_NS[:50], Z[:50])
    faults.add(parse_fault("s.stuck@5"))
    assert faults.apply(T_NS[50:60], Z[50:60])[0].tobytes() == np.tile(Z[49], (10, 1)).tobytes()
    faults.clear()
    faults.add(parse_fault("s.delay=0.5@6"))
    assert faults.apply(T_NS[60:70], Z[60:70])[0].tobytes() == Z[55:65].tobytes()


# bits

TEXTS = [
    "s.delay=0.13@3", "s.1.delay=0.05@8+4", "s.scale=1.01@1", "s.0.bias=0.5@2+3", "s.drift=0.1@4+9", "s.noise=3@5",
    "s.spike=9@6", "s.0.spike=2@7+1", "s.1.stuck@9+2", "s.nan@12+1", "s.intermittent=0.6@3+5", "s.broken@15+1",
]  # fmt: skip


@settings(deadline=None, max_examples=60)
@given(
    texts=st.lists(st.sampled_from(TEXTS), max_size=6),
    cuts=st.lists(st.integers(0, len(T_NS)), max_size=8),
    swaps=st.lists(st.tuples(st.integers(0, len(T_NS) - 1), st.integers(1, 5)), max_size=8),
    twins=st.lists(st.integers(1, len(T_NS) - 1), max_size=8),
    seed=st.integers(0, 5),
)
def test_however_readings_are_cut_into_batches_the_bits_are_the_same(texts, cuts, swaps, twins, seed):
    """Several faults at once, readings out of order or of equal stamps: one batch, any batches, one by one."""
    order = np.arange(len(T_NS))
    for at, by in swaps:
        to = min(at + by, len(T_NS) - 1)
        order[[at, to]] = order[[to, at]]
    t_ns, z = T_NS[order], Z[order]
    t_ns[twins] = t_ns[np.array(twins, dtype=int) - 1]
    whole_z, whole_keep = lying(*texts, seed=seed).apply(t_ns, z)
    for edges in ([0, *sorted(cuts), len(t_ns)], range(len(t_ns) + 1)):
        faults = lying(*texts, seed=seed)
        parts = [faults.apply(t_ns[a:b], z[a:b]) for a, b in pairwise(edges) if a < b]
        assert np.concatenate([one[0] for one in parts]).tobytes() == whole_z.tobytes()
        assert np.array_equal(np.concatenate([one[1] for one in parts]), whole_keep)


@pytest.mark.parametrize(
    "text",
    ["bias=0", "drift=0", "scale=1", "noise=1", "spike=0", "delay=0", "intermittent=1"],
)
def test_a_fault_of_no_size_changes_no_bit(text):
    """Minus zero, an angle beyond its circle and a number that is none included."""
    z = Z.copy()
    z[3], z[4], z[5] = -0.0, 7.0, np.nan
    out, keep = sent(f"s.{text}@0", z=z, angles=frozenset({0, 1}))
    assert keep.all()
    assert out.tobytes() == z.tobytes()


def test_the_seed_decides_every_draw():
    first, again, other = (sent("s.noise=3@0", "s.intermittent=0.5@0", seed=seed) for seed in (1, 1, 2))
    assert first[0].tobytes() == again[0].tobytes()
    assert np.array_equal(first[1], again[1])
    assert first[0].tobytes() != other[0].tobytes()
    assert not np.array_equal(first[1], other[1])


@given(st.sampled_from(TEXTS), st.floats(allow_nan=True, allow_infinity=True))
@settings(deadline=None)
def test_nothing_a_sensor_says_is_an_exception(text, value):
    z = Z.copy()
    z[90:110] = value
    sent(text, z=z, angles=frozenset({0}))
