"""Measures what consumers miss when the daemon that speaks is killed, or hangs, while another stands by.

Every estimate that anybody sends is looked at. Two yardsticks: the stretch of time just before, when nothing happens,
and how long the kernel takes to close a bare socket of the process that is killed. Run
`python -m tools.bench_failover`.
"""

from __future__ import annotations

import json
import random
import signal
import socket
import statistics
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from tools.bench_group import PATIENCE_S, PERIOD_NS, STRETCH_S, Car, Group, Heard, until


@dataclass(frozen=True, slots=True)
class Loss:
    """One loss of the daemon that speaks, all in ns of the monotonic clock.

    Args:
        from_ns, to_ns: the stretch that is looked at.   lost_ns: the signal.   speaks_ns: another speaks.
        closed_ns: a bare socket of the daemon's process is closed; `lost_ns` where it hangs.
    """

    from_ns: int
    lost_ns: int
    closed_ns: int
    speaks_ns: int
    to_ns: int


def gap_ms(heard: Sequence[Heard], from_ns: int, to_ns: int) -> float:
    """Longest time between two estimates one after the other, beyond the period of the readings, ms.

    Every pair counts of which a part lies in the stretch. Raises: ValueError where there is none.
    """
    came = [one.came_ns for one in heard]
    met = [b - a for a, b in pairwise(came) if b >= from_ns and a <= to_ns]
    return (max(met) - PERIOD_NS) / 1e6


def unanswered(sent: Sequence[tuple[int, int]], heard: Sequence[Heard]) -> list[int]:
    """When the readings without an estimate were sent, of (when, stamp)."""
    answered = {one.t_ns for one in heard}
    return [when_ns for when_ns, stamp in sent if stamp not in answered]


def said_twice(heard: Sequence[Heard]) -> int:
    """Estimates whose number was used before in their epoch."""
    return len(heard) - len({(one.epoch, one.seq) for one in heard})


def lose_once(group: Group, car: Car, how: signal.Signals, phase: float) -> Loss:
    """Lose the daemon that speaks at a phase of the period, 0 to 1, and have it back."""
    rank = group.active()
    until(car.hears_all)
    from_ns = time.monotonic_ns()
    with socket.create_connection(group.address(rank), PATIENCE_S) as bare:
        time.sleep(STRETCH_S + phase * PERIOD_NS / 1e9)
        epoch, lost_ns = car.heard[-1].epoch, time.monotonic_ns()
        group.lose(rank, how)
        if how is signal.SIGKILL:
            bare.recv(1)
        closed_ns = time.monotonic_ns()
        speaks_ns = car.wait_for_epoch_after(epoch)
    time.sleep(STRETCH_S)
    to_ns = time.monotonic_ns()
    group.have_back(rank, how)
    return Loss(from_ns, lost_ns, closed_ns, speaks_ns, to_ns)


def bench_failover(how: signal.Signals, times: int) -> dict[str, float]:
    """Gaps in the estimates when the daemon that speaks is lost so many times, ms, and what went missing or came twice.

    `readings` were sent in all, `missing` have no estimate, `missing_elsewhere` of them where no daemon was lost.
    """
    phases = random.Random(0)
    with tempfile.TemporaryDirectory() as folder, Group(Path(folder)) as group:
        group.start(0)
        group.start(1)
        with Car(group.endpoints) as car:
            losses = [lose_once(group, car, how, phases.random()) for _ in range(times)]
    gaps = [gap_ms(car.heard, loss.lost_ns, loss.speaks_ns) for loss in losses]
    quiet = [gap_ms(car.heard, loss.from_ns, loss.lost_ns - PERIOD_NS) for loss in losses]
    missing = unanswered(car.sent, car.heard)
    near = [at for at in missing if any(loss.lost_ns - PERIOD_NS <= at <= loss.to_ns for loss in losses)]
    return {
        "median_ms": statistics.median(gaps), "worst_ms": max(gaps),
        "quiet_median_ms": statistics.median(quiet), "quiet_worst_ms": max(quiet),
        "closed_median_ms": statistics.median((loss.closed_ns - loss.lost_ns) / 1e6 for loss in losses),
        "readings": len(car.sent), "missing": len(missing), "missing_elsewhere": len(missing) - len(near),
        "twice": said_twice(car.heard),
    }  # fmt: skip


if __name__ == "__main__":
    for lost, count in ((signal.SIGKILL, 20), (signal.SIGSTOP, 5)):
        print(json.dumps({lost.name: bench_failover(lost, count)}), flush=True)
