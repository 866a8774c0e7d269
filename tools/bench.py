"""`make bench`: every cost fusiond promises, measured in one run; the last line is one JSON object.

`python -m tools.bench --write docs/benchmarks.md` also writes the page. Ratios are taken against a named peer in the
same run, since machines differ and are noisy; `--only step` measures a part, and leaves the page's other rows.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

from fusiond.config import ServiceSection
from tools.bench_engine import bench_control, bench_memory, bench_replay, bench_start, bench_step
from tools.bench_failover import bench_failover
from tools.bench_loop import bench_command_age, bench_judging
from tools.bench_page import Row, page_of, table
from tools.bench_service import bench_round_trip, bench_throughput

TAKEOVER_MS = 1e3 * ServiceSection().takeover_s


def step_rows() -> list[Row]:
    """The whole step."""
    found = bench_step()
    five, fifteen, peer = found["five_us"], found["fifteen_us"], found["filterpy_us"]
    flight = found["flight_us"]
    ratio = five / peer
    name = "one reading through the step, 5 filters, 8 states, 4 sensors of 3 numbers"
    return [
        Row("2.step.five", name, five, "us", "", None, "<= 8", five <= 8.0),
        Row("2.step.five.ratio", f"{name}, against bare predict and update", five, "us", "filterpy", ratio,
            "<= 0.4", ratio <= 0.4),
        Row("4.cost", f"{name}, every test of faults", found["watched_us"], "us", "", None, "<= 12",
            found["watched_us"] <= 12.0),
        Row("2.step.fifteen", "the same, 1 filter, 15 states", fifteen, "us", "", None, "<= 6", fifteen <= 6.0),
        Row("3.step.strapdown", "one reading of configs/flight.toml, 1 filter: 15 states on a simulated flight, "
            "IMU and aiding as they come", flight, "us", "", None, "<= 6", flight <= 6.0),
    ]  # fmt: skip


def replay_rows() -> list[Row]:
    """Replay from file to result."""
    found = bench_replay()
    csv, mcap = found["csv"], found["mcap"]
    return [
        Row(
            "2.replay.csv",
            "replay, mini car, CSV without --out",
            csv,
            "1/s",
            "",
            None,
            ">= 100000",
            csv >= 1e5,
        ),
        Row("2.replay.mcap", "replay, mini car, packed MCAP", mcap, "1/s", "", None, ">= 50000", mcap >= 5e4),
    ]


def daemon_rows() -> list[Row]:
    """Throughput and round trip over Zenoh."""
    rate, trip = bench_throughput(), bench_round_trip()
    name = "highest paced rate without a missing seq, one record a put"
    rows = [
        Row("2.daemon.rate", f"{name}, recording off", rate["daemon_hz"], "1/s", "counting subscriber",
            rate["ratio"], ">= 0.3", rate["ratio"] >= 0.3),
        Row("2.daemon.rate.recording", f"{name}, recording on", rate["recording_hz"], "1/s", "counting subscriber",
            rate["ratio_recording"], ">= 0.2", rate["ratio_recording"] >= 0.2),
    ]  # fmt: skip
    for part in ("p50", "p99"):
        value, ratio = trip[f"daemon_{part}_us"], trip[f"ratio_{part}"]
        row = Row(f"2.daemon.rtt.{part}", f"publish to estimate at 1 kHz, {part}", value, "us", "zenoh echo", ratio,
                  "<= 1.5", ratio <= 1.5)  # fmt: skip
        rows.append(row)
    return rows


def command_rows() -> list[Row]:
    """From a reading's put to the command at the actuator, and what the command costs the step."""
    found, step, held = bench_command_age(), bench_control(), bench_judging()
    ratio, more = found["ratio"], step["lqg_more_us"]
    age = "age of a command at the actuator, from the put of the reading it answers, 1 kHz, LQG mini car in its loop"
    told = "what LQG with integral action adds to a reading in the step, mini car, 100 commands a second"
    judged = "longest that a reading, and the command after it, waits for a judgement, mini car whose range finder lies"
    judged += f"; honest: {held['honest_ms']:.2f}"
    return [
        Row(
            "5.command.age",
            f"{age}, p99",
            found["command_p99_us"],
            "us",
            "zenoh echo",
            ratio,
            "<= 1.5",
            ratio <= 1.5,
        ),
        Row("5.command.judged", judged, held["lying_ms"], "ms", "", None, "published", True),
        Row("5.control.step", told, more, "us", "", None, "<= 1", more <= 1.0),
    ]


def start_rows() -> list[Row]:
    """From `fusiond run` to the first estimate."""
    found = bench_start()
    cold, warm = found["cold_s"], found["warm_s"]
    return [
        Row(
            "2.start.cold", "start to first estimate, empty cache", cold, "s", "", None, "<= 15", cold <= 15.0
        ),
        Row(
            "2.start.warm", "start to first estimate, filled cache", warm, "s", "", None, "<= 2", warm <= 2.0
        ),
    ]


def memory_rows() -> list[Row]:
    """Growth over a long replay."""
    growth = bench_memory()["growth_mib"]
    name = "growth of the resident size from 10^6 to 10^7 replayed readings"
    return [Row("2.memory", name, growth, "MiB", "", None, "<= 1", growth <= 1.0)]


def failover_rows() -> list[Row]:
    """What consumers miss when the daemon that speaks is killed, or hangs."""
    killed, hung = bench_failover(signal.SIGKILL, 20), bench_failover(signal.SIGSTOP, 5)
    return [
        Row("4.failover.kill", _missed("killed", killed, 20), killed["median_ms"], "ms",
            "a bare socket of the killed process closes", killed["median_ms"] / killed["closed_median_ms"],
            "published", True),
        Row("4.failover.hang", _missed("stopped", hung, 5), hung["median_ms"], "ms", "takeover_s",
            hung["median_ms"] / TAKEOVER_MS, "published", True),
    ]  # fmt: skip


def _missed(how: str, found: dict[str, float], times: int) -> str:
    return (
        f"time without an estimate beyond the period, 200 Hz, where the one of two daemons that speaks is {how}, "
        f"median of {times}; worst: {found['worst_ms']:.1f}; nobody {how}: {found['quiet_median_ms']:.1f}, worst "
        f"{found['quiet_worst_ms']:.1f}; readings without an estimate: {found['missing']} of {found['readings']} "
        f"({found['missing_elsewhere']} at other times); numbers said twice: {found['twice']}"
    )


PARTS: dict[str, Callable[[], list[Row]]] = {
    "step": step_rows, "replay": replay_rows, "daemon": daemon_rows, "command": command_rows,
    "start": start_rows, "memory": memory_rows, "failover": failover_rows,
}  # fmt: skip


def main() -> None:
    """Measure, print the table to stderr and the JSON object as the last line of stdout."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", choices=list(PARTS), action="append", help="measure these parts")
    parser.add_argument("--write", type=Path, help="write the page there")
    chosen = parser.parse_args()
    rows: list[Row] = []
    for part in chosen.only or PARTS:
        print(f"bench: {part}", file=sys.stderr, flush=True)
        rows += PARTS[part]()
    print(table(rows), file=sys.stderr)
    if chosen.write:
        earlier = chosen.write.read_text(encoding="utf-8") if chosen.only and chosen.write.is_file() else ""
        chosen.write.write_text(page_of(rows, earlier), encoding="utf-8")
    print(json.dumps({"rows": [asdict(row) for row in rows]}))


if __name__ == "__main__":
    main()
