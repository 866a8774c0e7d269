"""`make chaos`: sensors that lie at random on streams in disorder; exit 1 where a law is broken.

    python -m tools.chaos [--trials 100] [--seed 0] [--only SYSTEM]... [--json]
    python -m tools.chaos --only minicar --seed 17 --trials 1        one trial again, as the table names it

A trial is a simulated run with one or two faults of random kind, size, onset and length, and one kind of disorder:
readings lost, repeated, late or garbled. Every fault is over by six tenths of the run. `laws` says what must hold.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass

import numpy as np

from fusiond.recording.digest import OutputDigest
from fusiond.simulation.registry import simulate
from tools.chaos.laws import Findings, astray, broken_laws, ill_at_the_end, slandered
from tools.chaos.mischief import disordered, drawn, lateness_s
from tools.chaos.systems import SYSTEMS, rig

PORTIONS = 50
"""Largest number of readings handed over at once when a run is repeated."""


@dataclass(frozen=True, slots=True)
class Trial:
    """What was done to which system, and what came of it."""

    system: str
    seed: int
    mischief: str
    readings: int
    findings: Findings


def trial(name: str, seed: int) -> Trial:
    """One run, twice: as a whole and in portions."""
    system, here = SYSTEMS[name], rig(name)
    rng = np.random.default_rng([seed, *name.encode()])
    mischief = drawn(rng, here.sigma, system.seconds)
    simulation = simulate(
        system.simulated,
        seed,
        system.seconds,
        jitter_s=lateness_s(mischief, here.slowest_hz),
        inject=[str(fault) for fault in mischief.faults],
        **system.options,
    )
    log = disordered(rng, here.log(simulation), mischief.disorder)
    here.engine.reset()
    reports = here.engine.process(log).copy()
    digest = OutputDigest()
    digest.update(reports)
    here.engine.reset()
    again = OutputDigest()
    ends = np.cumsum(rng.integers(1, PORTIONS, log.size))
    for portion in np.split(log, ends[ends < log.size]):
        again.update(here.engine.process(portion))
    layout = here.assembly.layout
    liars = {s.name for s in layout.sensors} if mischief.disorder == "garbled" else mischief.liars
    findings = Findings(
        broken_laws(reports, log.size, digest.hexdigest(), again.hexdigest()),
        ill_at_the_end(layout, reports),
        slandered(layout, reports, liars),
        astray(layout, reports, simulation),
    )
    return Trial(name, seed, str(mischief), int(log.size), findings)


def study(names: Sequence[str], seeds: Sequence[int], processes: int) -> list[Trial]:
    """All trials of all systems; a system stays in one process, which compiles it once."""
    found: list[Trial] = []
    with ProcessPoolExecutor(processes) as pool:
        for trials in pool.map(trials_of, names, [seeds] * len(names)):
            found += trials
    return found


def trials_of(name: str, seeds: Sequence[int]) -> list[Trial]:
    """The trials of one system, counted on stderr."""
    found = []
    for number, seed in enumerate(seeds):
        found.append(trial(name, seed))
        if (number + 1) % 10 == 0 or number + 1 == len(seeds):
            print(f"chaos: {name}, {number + 1} of {len(seeds)}", file=sys.stderr, flush=True)
    return found


def table(trials: Sequence[Trial]) -> str:
    """Counts for every system, then every trial with something to say."""
    lines = [
        "| system | trials | laws broken | ill at the end | innocent named | astray |",
        "|---|---|---|---|---|---|",
    ]
    for name in dict.fromkeys(t.system for t in trials):
        mine = [t.findings for t in trials if t.system == name]
        counts = (
            sum(bool(getattr(f, what)) for f in mine) for what in ("broken", "ill", "slandered", "astray")
        )
        lines.append(f"| {name} | {len(mine)} | {' | '.join(map(str, counts))} |")
    for t in trials:
        f = t.findings
        said = [*f.broken, *f.ill, *(f"{who} named" for who in f.slandered), *f.astray]
        if said:
            lines.append(f"{t.system} --seed {t.seed}: {t.mischief}: {'; '.join(said)}")
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the study; 1 where a law was broken."""
    parser = argparse.ArgumentParser(
        prog="python -m tools.chaos",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--trials", type=int, default=100, help="of each system; default 100")
    parser.add_argument("--seed", type=int, default=0, help="of the first trial; the next has the next")
    parser.add_argument("--only", choices=list(SYSTEMS), action="append", help="this system")
    parser.add_argument("--processes", type=int, default=2, help="systems put through side by side")
    parser.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    chosen = parser.parse_args(arguments)
    seeds = range(chosen.seed, chosen.seed + chosen.trials)
    trials = study(chosen.only or list(SYSTEMS), seeds, chosen.processes)
    print(json.dumps({"trials": [asdict(t) for t in trials]}) if chosen.json else table(trials))
    return int(any(t.findings.broken for t in trials))


if __name__ == "__main__":
    sys.exit(main())
