"""The small parts of the service, each by itself."""

from __future__ import annotations

import json
import socket
import threading

import numpy as np
import pytest

from fusiond.errors import ConnectionFailed
from fusiond.service.counters import REMEMBERED, Counters, Gaps
from fusiond.service.health_watch import HealthWatch, Transition
from fusiond.service.intake import subscriptions
from fusiond.service.limiter import RateLimiter
from fusiond.service.mailbox import Mailbox
from fusiond.service.messages import ControlMessage, EstimateMessage, dumps, report_message
from fusiond.service.notify import Notifier
from fusiond.service.output_record import decode_output, encode_control, encode_estimate
from fusiond.service.report_rows import ReportRows
from fusiond.service.sessions import open_session, session_options
from fusiond.service.telemetry import QUIET_NS, Voice
from fusiond.types import Health, ServiceHealth, Verdict

NAN = float("nan")


@pytest.mark.parametrize(
    ("seqs", "lost"),
    [
        ([0, 1, 2, 3], 0),
        ([5, 6, 9], 2),
        ([0, 3, 1, 2], 0),
        ([1, 0, 2, 3], 0),
        ([0, 2, 2, 2], 1),
        ([100, 101, 0, 1, 2], 0),
        ([7, 2**40, 2**40 + 1], 0),
    ],
    ids=["none", "two", "late, not lost", "late first", "duplicates", "started anew", "another count"],
)
def test_gaps_count_what_never_came(seqs, lost):
    gaps = Gaps()
    for seq in seqs:
        gaps.note(seq)
    assert gaps.lost == lost


def test_gaps_remember_within_bounds():
    gaps = Gaps()
    for seq in range(0, 10 * REMEMBERED, 2):
        gaps.note(seq)
    assert gaps.lost == 5 * REMEMBERED - 1
    assert len(gaps._open) <= REMEMBERED


@pytest.mark.parametrize(("rate_hz", "passed"), [(1000.0, 1000), (100.0, 100), (30.0, 30)])
def test_a_stream_is_thinned_to_its_limit(rate_hz, passed):
    limiter = RateLimiter(rate_hz)
    assert sum(limiter.passes(k * 1_000_000) for k in range(1000)) == pytest.approx(passed, abs=5)


def test_a_jittering_stream_of_the_limit_passes_whole():
    rng = np.random.default_rng(0)
    times = (np.arange(1000) * 20e6 + rng.uniform(-2e6, 2e6, 1000)).astype(int)
    limiter = RateLimiter(50.0)
    assert all(limiter.passes(int(t)) for t in times)


def test_time_that_jumped_back_starts_over():
    limiter = RateLimiter(50.0)
    assert limiter.passes(10**18)
    assert limiter.passes(0)
    assert not limiter.passes(1_000_000)


def test_a_full_mailbox_drops_the_oldest_and_counts_it():
    taken = []
    mailbox = Mailbox(3, taken.extend)
    for k in range(5):
        mailbox.put(k)
    mailbox.work_off()
    assert taken == [2, 3, 4]
    assert mailbox.dropped == 2


def test_what_is_handed_over_waits_behind_what_waits_and_behind_who_works():
    taken = []
    mailbox = Mailbox(10, taken.append)
    mailbox.hand_over(1)
    mailbox.put(2)
    mailbox.hand_over(3)
    with mailbox.baton:
        mailbox.hand_over(4)
        assert len(mailbox) == 1
    mailbox.work_off()
    assert taken == [[1], [2, 3], [4]]


def test_everything_put_is_worked_off_once_in_order_by_one_at_a_time():
    """Four readers at once: nothing is left behind, nothing twice, and no two work at the same time."""
    taken, working = [], threading.Lock()

    def work(arrivals):
        assert working.acquire(blocking=False), "two at a time"
        taken.extend(arrivals)
        working.release()

    mailbox = Mailbox(100_000, work)

    def read(reader):
        for k in range(5000):
            if k % 3:
                mailbox.hand_over((reader, k))
            else:
                mailbox.put((reader, k))
                mailbox.work_off()

    threads = [threading.Thread(target=read, args=(reader,)) for reader in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(taken) == [(reader, k) for reader in range(4) for k in range(5000)]
    for reader in range(4):
        mine = [k for who, k in taken if who == reader]
        assert mine == sorted(mine)


def test_the_fewest_subscriptions_cover_every_key():
    keys = ["fusiond/car/sensor/gps", "other/imu", "fusiond/car/reference", "other/*"]
    assert [str(e) for e in subscriptions("fusiond/car", keys)] == [
        "fusiond/car/sensor/*",
        "fusiond/car/reference",
        "fusiond/car/applied",
        "other/imu",
        "other/*",
    ]


@pytest.mark.parametrize("bad", [NAN, float("inf")])
def test_a_state_that_is_not_finite_goes_out_as_invalid(bad, assembly):
    message = EstimateMessage(assembly.layout).content(
        1, 1, 1, 0, (0.0,) * 3, (0.0, bad, 0.0), (1.0, 1.0, 1.0), 0, None
    )
    assert (message["state"], message["std"], message["health"]) == ({}, {}, "invalid")
    record = decode_output(encode_estimate(1, 1, 1, 0, (0.0,) * 3, (0.0, bad, 0.0), (1.0, 1.0, 1.0), 0))
    assert (record["state"], record["std"], record["health"]) == ([], [], "invalid")


def test_a_command_that_is_not_finite_is_zero_and_not_valid(assembly):
    message = ControlMessage(assembly.layout).content(1, 1, 1, (NAN,), True, 0.0, 0)
    assert (message["u"], message["valid"]) == ({"force": 0.0}, False)
    record = decode_output(encode_control(1, 1, 1, (NAN,), True, 0.0, 0))
    assert (record["u"], record["valid"]) == ([0.0], False)


def test_packed_outputs_say_what_json_says():
    estimate = decode_output(encode_estimate(3_500_000_000, 7, 9, 2, (0.0, -3.0), (1.0, 2.0), (0.5, 0.25), 1))
    assert estimate == {
        "t": 3.5, "t_ns": 3_500_000_000, "seq": 7, "epoch": 9, "resets": 2, "jump": [0.0, -3.0],
        "state": [1.0, 2.0], "std": [0.5, 0.25], "health": "degraded",
    }  # fmt: skip
    command = decode_output(encode_control(-1, 1, 9, (1.5,), True, 0.125, 0))
    assert (command["u"], command["valid"], command["age_s"], command["level"]) == (
        [1.5],
        True,
        0.125,
        "nominal",
    )
    spoilt = bytearray(encode_control(1, 1, 1, (1.5,), True, 0.0, 0))
    spoilt[50] ^= 1
    with pytest.raises(ValueError, match="not a sound record"):
        decode_output(bytes(spoilt))


def test_rows_of_reports_are_the_fields_of_the_record(assembly):
    reports = np.zeros(2, assembly.layout.report)
    reports["t_ns"], reports["sensor"], reports["service"], reports["state_t_ns"] = (
        (1, 2),
        (0, -1),
        (3, 1),
        (5, 6),
    )
    reports["x"][1], reports["std"][1] = (1, 2, 3), (4, 5, 6)
    reports["command_valid"][1], reports["command"][1] = 1, 0.5
    reports["resets"][1], reports["jump"][1], reports["unobserved"][1] = 2, (7, 8, 9), 4
    rows = ReportRows(assembly.layout)
    raw = rows.open(reports)
    assert list(rows.heads(raw)) == [(1, 0, 0, 0, 3, 5, 0), (2, -1, 0, 0, 1, 6, 0)]
    assert rows.state(raw, 1) == ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0), 2, (7.0, 8.0, 9.0), 4)
    assert rows.command(raw, 1) == (True, (0.5,))


def test_transitions_come_in_order_and_only_once(assembly):
    layout = assembly.layout
    reports = np.zeros(4, layout.report)
    reports["t_ns"] = range(4)
    reports["health"][2:, layout.numbers["ultrasonic"]] = Health.SILENT
    reports["service"][2:] = ServiceHealth.DEGRADED
    watch = HealthWatch(layout)
    assert watch.observe(reports) == [
        Transition(0, None, "invalid", "nominal"),
        Transition(2, "ultrasonic", "healthy", "silent"),
        Transition(2, None, "nominal", "degraded"),
    ]
    assert watch.observe(reports[3:]) == []
    assert watch.observe(reports[:1]) == [
        Transition(0, "ultrasonic", "silent", "healthy"),
        Transition(0, None, "degraded", "nominal"),
    ]
    assert watch.observe(reports[:1]) == []


def test_a_rate_is_not_that_of_the_moment_between_two_looks(assembly):
    counters = Counters(assembly.layout)
    number = assembly.layout.numbers["ultrasonic"]
    readings, reports = np.zeros(1, assembly.layout.reading), np.zeros(1, assembly.layout.report)
    readings["sensor"] = number
    counters.rate(0)
    for _ in range(50):
        counters.note(readings, reports)
    counters.rate(1_000_000_000)
    counters.note(readings, reports)
    counters.rate(1_001_000_000)
    assert counters.rate_hz[number] == 50.0
    counters.rate(2_000_000_000)
    assert counters.rate_hz[number] == 1.0


def test_a_report_as_json_has_no_infinity(assembly):
    report = np.zeros(1, assembly.layout.report)[0]
    report["limit"], report["dof"], report["length"] = np.inf, 1, 1
    report["sensor"], report["verdict"] = assembly.layout.numbers["ultrasonic"], Verdict.TOO_LATE
    message = json.loads(dumps(report_message(report, assembly.layout, 1, 2)))
    assert message["limit"] is None
    assert message["verdict"] == "too_late"


def test_the_service_manager_is_told_and_fed_while_the_loop_goes_round(tmp_path):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as ear:
        ear.bind(str(tmp_path / "ear"))
        ear.settimeout(5.0)
        notifier = Notifier({"NOTIFY_SOCKET": str(tmp_path / "ear"), "WATCHDOG_USEC": "4000000"})
        notifier.ready()
        for now_ns in (10**10, 10**10 + 10**8, 10**10 + 10**9):
            notifier.went_round(now_ns)
        notifier.stopping()
        assert [ear.recv(100) for _ in range(4)] == [b"READY=1", b"WATCHDOG=1", b"WATCHDOG=1", b"STOPPING=1"]


def test_without_a_service_manager_nothing_is_told():
    notifier = Notifier({})
    notifier.ready()
    notifier.went_round(10**18)
    assert notifier.feed_every_ns == 0


def test_what_repeats_is_held_back_and_counted():
    lines = []

    class Logger:
        def warning(self, text, **facts):
            lines.append((text, facts))

    voice = Voice(Logger())
    for k in range(5):
        voice.warn("gps", k, "gps: silent")
    voice.warn("gps", QUIET_NS + 5, "gps: silent")
    assert lines == [("gps: silent", {}), ("gps: silent", {"held_back": 4})]


def test_an_endpoint_of_an_unknown_host_is_named_as_one_to_listen_on():
    with pytest.raises(
        ConnectionFailed, match=r"^listen tcp/nowhere\.invalid:7447: .*; choose another --listen"
    ):
        open_session(session_options("peer", listen=["tcp/nowhere.invalid:7447"]), timeout_s=0.0)
