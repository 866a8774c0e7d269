"""Measure adaptation and write docs/adaptation.md with its picture.

python -m tools.pages.adaptation [--docs docs] [--quick]
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from tools.bench_page import machine, table
from tools.pages.figures import figure
from tools.scoreboard.__main__ import together
from tools.scoreboard.board import FULL, QUICK
from tools.scoreboard.plants import plant_of
from tools.scoreboard.steps_of_noise import STAY, configuration, noise_std
from tools.scoreboard.watching import assembled, readings_of

PAGE = Path(__file__).with_name("adaptation.md")
SHOWN = {"interacting": "#00798c", "variational": "#edae49", "fuzzy": "#d1495b"}
FACTOR = 25.0


def picture(into: Path) -> None:
    """R in use of three methods on the same readings, and the true one."""
    plant = plant_of(configuration())
    rng, std = np.random.default_rng(77), noise_std(float(plant.R[0]), FACTOR)
    clean = plant.wrong(R=0.0).run(rng, 1, 3 * STAY)[0][:, :, 0]
    z = clean + rng.standard_normal(clean.shape) * std
    with figure(into / "adaptation.svg", 9.0, 3.2) as drawn:
        place = drawn.subplots()
        for method, color in SHOWN.items():
            assembly = assembled(configuration(method=method))
            reports = assembly.engine().process(readings_of(assembly, z[:, :, None])[0])
            place.plot(reports["R_used"][:, 0], color=color, lw=0.9, label=method)
        place.plot(std**2, color="#222222", lw=1.0, label="true")
        place.set(xlabel="reading", ylabel="R, m²", yscale="log")
        place.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=4)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, draw, write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--docs", type=Path, default=Path("docs"), help="folder of the page")
    parser.add_argument("--quick", action="store_true", help="few runs: whether it works, not how well")
    given = parser.parse_args(arguments)
    rows = together(["adaptation", "adaptation-faults"], QUICK if given.quick else FULL, 2).rows
    faults = [row for row in rows if row.id.split(".")[2] in ("delay", "named", "misnamed", "tenth")]
    text = PAGE.read_text(encoding="utf-8").format(
        day=datetime.now(UTC).date(), machine=machine(),
        steps=table([row for row in rows if row not in faults]), faults=table(faults),
    )  # fmt: skip
    picture(given.docs / "pictures")
    (given.docs / "adaptation.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
