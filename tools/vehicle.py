"""Measure seed 002's vehicle and write docs/vehicle.md with its pictures.

    python -m tools.vehicle          everything (five minutes)

Needs the multi-body simulator: install commonroad-vehicle-models (it is in the extra `test`).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from fusiond.errors import ConfigError
from tools import vehicle_tables

DOCS = Path(__file__).resolve().parents[1] / "docs"
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


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the page; returns the exit code."""
    argparse.ArgumentParser(prog="python -m tools.vehicle", description="Write docs/vehicle.md.").parse_args(
        arguments
    )
    from tools.vehicle_pictures import draw

    try:
        text = page()
    except ConfigError as error:
        print(error, file=sys.stderr)
        return 2
    (DOCS / "vehicle.md").write_text(text, encoding="utf-8")
    draw(DOCS / "pictures")
    return 0


if __name__ == "__main__":
    sys.exit(main())
