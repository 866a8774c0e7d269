"""`make scoreboard`: how fast faults are found, over the limit; the last line is one JSON object.

    python -m tools.scoreboard [--write docs/scoreboard.md] [--quick] [--only PART] [--keep DIR]

Every row runs a configuration through the engine's step, with thresholds from the configuration alone, on seeds that
nothing was derived from. `--write` also writes the page and its pictures. With `--keep` what is measured is kept in a
folder, and parts not measured now are taken from there.
"""

from __future__ import annotations

import argparse
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from pathlib import Path

from tools.bench_page import table
from tools.scoreboard.adaptation import adaptation_faults_part, adaptation_part
from tools.scoreboard.board import FULL, QUICK, Effort, Part, Result
from tools.scoreboard.control import control_part
from tools.scoreboard.delays import reference_part, white_part
from tools.scoreboard.drifts import drift_part
from tools.scoreboard.exclusion import exclusion_part
from tools.scoreboard.false_alarms import promise_part, wrong_noise_part
from tools.scoreboard.information import finite_part
from tools.scoreboard.keeping import dumped, keep, kept
from tools.scoreboard.kinds import kinds_part
from tools.scoreboard.levels import levels_part
from tools.scoreboard.loops import loops_part
from tools.scoreboard.naming import naming_part
from tools.scoreboard.outages import outages_part
from tools.scoreboard.recordings import recordings_part

PARTS: dict[str, Part] = {
    "promise": promise_part, "wrong-noise": wrong_noise_part, "white": white_part, "reference": reference_part,
    "finite": finite_part, "drift": drift_part, "naming": naming_part,
    "exclusion": exclusion_part, "outages": outages_part, "kinds": kinds_part, "levels": levels_part,
    "adaptation": adaptation_part, "adaptation-faults": adaptation_faults_part,
    "control": control_part, "loops": loops_part, "recordings": recordings_part,
}  # fmt: skip


def measured(name: str, effort: Effort, folder: Path | None) -> Result:
    """One part, with its time on stderr, kept in the folder."""
    begun = time.perf_counter()
    result = PARTS[name](effort)
    if folder is not None:
        keep(folder, name, result)
    print(f"scoreboard: {name}, {time.perf_counter() - begun:.0f} s", file=sys.stderr, flush=True)
    return result


def together(names: list[str], effort: Effort, processes: int, folder: Path | None = None) -> Result:
    """The parts named, run side by side, among those kept in the folder."""
    count = len(names)
    with ProcessPoolExecutor(processes) as pool:
        parts = pool.map(measured, names, [effort] * count, [folder] * count)
        found = dict(zip(names, parts, strict=True))
    whole = Result()
    for name in PARTS:
        part = found.get(name) or (kept(folder, name) if folder is not None else Result())
        whole.rows += part.rows
        whole.curves |= part.curves
    return whole


def main(arguments: list[str] | None = None) -> None:
    """Measure, print the table to stderr and the JSON object as the last line of stdout."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", choices=list(PARTS), action="append", help="measure these parts")
    parser.add_argument("--quick", action="store_true", help="few runs: whether it works, not how well")
    parser.add_argument("--processes", type=int, default=2, help="parts measured side by side")
    parser.add_argument("--write", type=Path, help="write the page there")
    parser.add_argument(
        "--keep", type=Path, help="keep what is measured in this folder; use what is kept there"
    )
    chosen = parser.parse_args(arguments)
    effort = QUICK if chosen.quick else FULL
    result = together(chosen.only or list(PARTS), effort, chosen.processes, chosen.keep)
    print(table(result.rows), file=sys.stderr)
    if chosen.write:
        from tools.scoreboard.page import write  # matplotlib, which measuring does without

        write(chosen.write, result, chosen.quick)
    print(dumped({"rows": [asdict(row) for row in result.rows]}))


if __name__ == "__main__":
    main()
