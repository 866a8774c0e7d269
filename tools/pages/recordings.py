"""Measure the recordings and write docs/recordings.md with its pictures.

    python -m tools.pages.recordings [--data FOLDER] [--docs docs]

FOLDER holds the recordings (default: FUSIOND_DATA, else ../shared/data). Exit 0 done, 1 a figure is not reached,
2 the operator's mistake.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from fusiond.errors import FusiondError
from tools.pages import recording_pictures, recording_ranges_pictures, recording_strapdown_pictures
from tools.pages.recorded import FOLDERS, SOURCES, Recorded, import_from, recorded
from tools.pages.recording_ranges_rows import mower_rows
from tools.pages.recording_rows import (
    Row,
    dresden_rows,
    dresden_variants,
    jackal_rows,
    outages_everywhere,
    table,
    udacity_rows,
)
from tools.pages.recording_strapdown_rows import delays, highway_rows, iris_rows, jackal_3d_rows

PAGE = Path(__file__).with_name("recordings_page.md")
PROJECT = Path(__file__).resolve().parents[2]


def parser() -> argparse.ArgumentParser:
    """The command line."""
    command = argparse.ArgumentParser(
        prog="python -m tools.pages.recordings", description="Measure the recordings."
    )
    data = os.environ.get("FUSIOND_DATA", PROJECT.parent / "shared" / "data")
    command.add_argument("--data", type=Path, default=data, help="folder of the recordings")
    command.add_argument("--docs", type=Path, default=PROJECT / "docs", help="where the page goes")
    return command


def measure(runs: dict[str, Recorded]) -> dict[str, list[Row]]:
    """Rows of every table, by its place in the page."""
    return {
        "jackal": jackal_rows(runs["jackal"]),
        "udacity": udacity_rows(runs["udacity_laser_radar"], runs["udacity_laser_radar_robot"]),
        "dresden": dresden_rows(runs["dresden_car"]),
        "jackal_3d": jackal_3d_rows(runs["jackal_3d"]),
        "iris": iris_rows(runs["px4_iris"]),
        "mower": mower_rows(runs["plaza2_scale"], runs["plaza2"]),
        "highway": highway_rows(runs["comma2k19"]),
    }


def draw(runs: dict[str, Recorded], into: Path) -> None:
    """Every picture of the page."""
    into.mkdir(parents=True, exist_ok=True)
    recording_pictures.jackal(runs["jackal"], into / "recording_jackal.svg")
    recording_pictures.dresden(runs["dresden_car"], into / "recording_dresden.svg")
    recording_pictures.clock(runs["dresden_car"], into / "recording_dresden_clock.svg")
    pair = (runs["udacity_laser_radar"], runs["udacity_laser_radar_robot"])
    recording_pictures.udacity(*pair, into / "recording_udacity.svg")
    recording_strapdown_pictures.jackal_3d(runs["jackal_3d"], into / "recording_jackal_3d.svg")
    recording_strapdown_pictures.iris(runs["px4_iris"], into / "recording_iris.svg")
    recording_strapdown_pictures.highway(runs["comma2k19"], into / "recording_highway.svg")
    both = (runs["plaza2_scale"], runs["plaza2"])
    recording_ranges_pictures.mower(*both, into / "recording_mower.svg")


def run_all(data: Path, into: Path) -> dict[str, Recorded]:
    """Every recording imported and met with its configurations, by the configuration's name."""
    logs = {name: import_from(data / FOLDERS.get(name, name), name, into) for name in SOURCES}
    runs = {name: recorded(name, log) for name, log in logs.items()}
    for name, log in (("udacity_laser_radar_robot", "udacity_laser_radar"), ("plaza2_scale", "plaza2")):
        runs[name] = recorded(name, logs[log])
    return runs


def main(arguments: Sequence[str] | None = None) -> int:
    """Import, run, measure, draw, write."""
    given = parser().parse_args(arguments)
    if not given.data.is_dir():
        print(f"{given.data}: no such folder; say where the recordings are with --data", file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory() as folder:
        try:
            runs = run_all(given.data, Path(folder))
            tables = measure(runs)
            extra = {
                "variants": dresden_variants(runs["dresden_car"]),
                "everywhere": outages_everywhere(runs["dresden_car"]),
                "delays": delays(runs["comma2k19"]),
            }
            draw(runs, given.docs / "pictures")
        except FusiondError as error:
            print(error, file=sys.stderr)
            return 1
    page = PAGE.read_text(encoding="utf-8")
    for name, text in (extra | {name: table(rows) for name, rows in tables.items()}).items():
        page = page.replace("{{" + name + "}}", text)
    (given.docs / "recordings.md").write_text(page, encoding="utf-8")
    missed = [row.what for rows in tables.values() for row in rows if not row.ok]
    print(*(f"{what}: not reached" for what in missed), sep="\n", end="\n" if missed else "")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
