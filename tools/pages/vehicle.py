"""Measure seed 002's vehicle and write docs/vehicle.md with its pictures.

    python -m tools.pages.vehicle                              everything (five minutes)
    python -m tools.pages.vehicle --log dlc_60kmh DLC.csv      one manoeuvre as a log, and DLC_truth.csv

Needs the multi-body simulator: install commonroad-vehicle-models (it is in the extra `test`).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from fusiond.errors import ConfigError
from fusiond.simulation.arrivals import arrive
from fusiond.simulation.logs import write_log, write_truth
from fusiond.simulation.tables import Simulation
from fusiond.simulation.vehicle_equations import COLUMNS
from fusiond.simulation.vehicle_manoeuvres import SEED_002
from fusiond.simulation.vehicle_sensors import readings
from tools.pages import vehicle_tables
from tools.pages.multibody import manoeuvre

DOCS = Path(__file__).resolve().parents[2] / "docs"
TEMPLATE = Path(__file__).resolve().parent / "vehicle_page.md"
SECTIONS: dict[str, Callable[[], str]] = {
    "bound": vehicle_tables.bound_table,
    "manoeuvres": vehicle_tables.manoeuvre_table,
    "outage": vehicle_tables.outage_table,
    "sideslip": vehicle_tables.sideslip_table,
}
"""Tables by the place they take on the page."""


def page() -> str:
    """The whole page: the template with a table in the place of each {{section}}."""
    text = TEMPLATE.read_text(encoding="utf-8")
    for name, made in SECTIONS.items():
        text = text.replace(f"{{{{{name}}}}}", made())
    return text


def write(name: str, path: Path, seed: int) -> None:
    """Write one manoeuvre's readings and truth as CSV; raises ConfigError for a name that is none."""
    named = {asked.name: asked for asked in SEED_002}
    if name not in named:
        raise ConfigError(f"vehicle: no manoeuvre {name!r}; choose one of {', '.join(named)}")
    motion = manoeuvre(named[name])
    arrived, arrivals_ns = arrive(readings(motion, seed), seed, 0.0, 0.0)
    simulation = Simulation(name, seed, arrived, arrivals_ns, motion.truth(COLUMNS))
    write_log(path, simulation)
    write_truth(path.with_name(f"{path.stem}_truth.csv"), simulation.truth)


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the page, or a log; returns the exit code."""
    command = argparse.ArgumentParser(
        prog="python -m tools.pages.vehicle", description="Write docs/vehicle.md."
    )
    command.add_argument("--log", nargs=2, metavar=("MANOEUVRE", "OUT.csv"), help="write a log instead")
    command.add_argument("--seed", type=int, default=0)
    given = command.parse_args(arguments)
    try:
        if given.log:
            write(given.log[0], Path(given.log[1]), given.seed)
            return 0
        text = page()
    except ConfigError as error:
        print(error, file=sys.stderr)
        return 2
    from tools.pages.vehicle_pictures import draw  # matplotlib, which a log does without

    (DOCS / "vehicle.md").write_text(text, encoding="utf-8")
    draw(DOCS / "pictures")
    return 0


if __name__ == "__main__":
    sys.exit(main())
