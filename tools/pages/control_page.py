"""Measure what control costs and withstands, and write docs/control.md with its picture.

python -m tools.pages.control_page [--write docs/control.md] [--quick]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from tools.bench_page import machine, table
from tools.pages.figures import figure
from tools.scoreboard.board import FULL, QUICK, Result
from tools.scoreboard.control import control_part
from tools.scoreboard.loops import loops_part

TEXT = (Path(__file__).parent / "control_page.md").read_text(encoding="utf-8")
OURS, OTHER, BOUND = "#00798c", "#edae49", "#222222"


def faults_table(result: Result) -> str:
    """What became of every fault, a row each, both plants side by side."""
    plants = {
        name.removeprefix("control.faults."): curve
        for name, curve in result.curves.items() if name.startswith("control.faults.")
    }  # fmt: skip
    head = " | ".join(f"{name}: farthest | at the end" for name in plants)
    lines = [f"| fault | {head} |", "|---|" + "---|---|" * len(plants)]
    for place, fault in enumerate(next(iter(plants.values()))["name"]):
        cells = [_cells(curve, place) for curve in plants.values()]
        lines.append(f"| {fault} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _cells(curve: Mapping[str, Sequence[Any]], place: int) -> str:
    times, safe = curve["times"][place], curve["safe"][place]
    if curve["in_time"][place]:
        end = f"safe {safe:.2f} s after the last sound sensor"
    else:
        end = f"{times:.1f} x" if curve["kept"][place] else f"**{times:.1f} x**"
    return f"{curve['farthest'][place]:.3f} m | {end}"


def draw(path: Path, curves: Mapping[str, Mapping[str, Sequence[Any]]]) -> None:
    """The loss of a sensor, and the J-turns."""
    with figure(path, 10.0, 3.2) as drawn:
        left, right = drawn.subplots(1, 2)
        for fade, color, label in (("0", OTHER, "no fade"), ("3", OURS, "fade of 3 steps")):
            curve = curves.get(f"control.switch.{fade}")
            if curve is not None:
                left.plot(curve["step"], curve["cost"], color=color, lw=1.2, label=label)
        left.axvline(0.0, color=BOUND, lw=0.6)
        left.legend(loc="lower right")
        left.set(title="the better sensor is lost", xlabel="steps since", ylabel="mean cost of a step")
        for speed, color in (("60", OURS), ("90", OTHER), ("120", "#d1495b")):
            curve = curves.get(f"control.jturn.{speed}")
            if curve is not None:
                right.plot(curve["t"], curve["wanted"], color=BOUND, lw=0.8, ls=":")
                right.plot(curve["t"], curve["yaw_rate"], color=color, lw=1.2, label=f"{speed} km/h")
        right.legend(loc="lower right")
        right.set(title="J-turn: wanted (dotted) and driven", xlabel="s", ylabel="yaw rate, rad/s")


def main() -> None:
    """Measure, print, and write where asked."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--write", type=Path, help="write the page there")
    parser.add_argument("--quick", action="store_true", help="few runs: whether it works, not how well")
    chosen = parser.parse_args()
    effort = QUICK if chosen.quick else FULL
    cost, loops = control_part(effort), loops_part(effort)
    text = TEXT.format(
        day=datetime.now(UTC).date(), machine=machine(), quick=", few runs only" if chosen.quick else "",
        cost=table(cost.rows), loops=table(loops.rows), losses=f"{effort.runs(2500, 50):,}",
        faults=faults_table(loops),
    )  # fmt: skip
    print(text, file=sys.stderr)
    if chosen.write:
        chosen.write.write_text(text, encoding="utf-8")
        pictures = chosen.write.parent / "pictures"
        pictures.mkdir(parents=True, exist_ok=True)
        draw(pictures / "control.svg", cost.curves | loops.curves)


if __name__ == "__main__":
    main()
