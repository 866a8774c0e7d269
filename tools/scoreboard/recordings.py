"""Recordings nobody here made: who is called faulty where nothing was injected, and what is said of faults they hold.

Each runs with its configuration as it is in configs/; where that has no section `[faults]`, with one that says nothing.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from fusiond import config
from fusiond.assembly.assembly import Assembly, assemble
from fusiond.demo.injecting import inject_into
from fusiond.recording.importing import import_recording
from fusiond.recording.log import open_log
from fusiond.types import NANOSECONDS, Kind
from tools.pages.recorded import CONFIGS, FOLDERS, Records, import_from
from tools.pages.recording_ranges_rows import SCALE
from tools.scoreboard.board import Effort, Result, Row
from tools.scoreboard.judging import NAMED

CLEAN = {
    "jackal": np.inf, "udacity_laser_radar": np.inf, "dresden_car": np.inf, "px4_iris": np.inf, "comma2k19": np.inf,
}  # fmt: skip
"""Recordings in which no sensor lies, and for how long each is run, s."""
MANOEUVRES = ("dlc_60kmh", "dlc_100kmh", "jturn_60kmh", "jturn_100kmh")
"""Those of `commonroad_maneuvers` in which a car with linear tyres is near enough the multi-body one."""
INJECTED = {"udacity_laser_radar": ("laser", "laser.bias=2@10+5", 10.0, 1.0)}
"""By recording: the sensor that lies, how, since when, and within how many seconds it is to be named."""
SCALE_WITHIN = 0.005
"""How near the scale of the mower's ranges (docs/recordings.md) is to be told."""
WATCHED = "\n[faults]\n"


def data() -> Path:
    """Where the recordings are, or would be: FUSIOND_DATA, a relative one counted from the project's root."""
    project = CONFIGS.parent
    return (project / os.environ.get("FUSIOND_DATA", "../shared/data")).resolve()


@dataclass(frozen=True, slots=True)
class Told:
    """What a run said: reports, by whose assembly."""

    assembly: Assembly
    reports: Records

    def names(self) -> dict[tuple[str, str], float]:
        """Every sensor called faulty, with the kind of its fault, and when first, s since the first reading."""
        found: dict[tuple[str, str], float] = {}
        t_s = (self.reports["t_ns"] - self.reports["t_ns"][0]) / NANOSECONDS
        for sensor in self.assembly.layout.sensors:
            named = np.isin(self.reports["health"][:, sensor.number], NAMED)
            for kind in np.unique(self.reports["fault"][named, sensor.number]):
                first = int(np.argmax(named & (self.reports["fault"][:, sensor.number] == kind)))
                found[sensor.name, Kind(int(kind)).label] = float(t_s[first])
        return found

    def said(self) -> str:
        """The same as a text."""
        each = [f"{who} {kind} at {t_s:.1f} s" for (who, kind), t_s in self.names().items()]
        return ", ".join(each) or "nobody"

    def doubts(self) -> str:
        """Shares of the reports in which somebody is suspected or called faulty, and the model is blamed."""
        anybody, model = self.reports["health"].any(axis=1), self.reports["model"]
        return f"somebody not healthy {anybody.mean():.1%}, the model blamed {model.mean():.1%} of the time"

    def sizes(self, sensor: str, kind: Kind) -> Any:
        """Every size told of this fault."""
        number = self.assembly.layout.numbers[sensor]
        named = np.isin(self.reports["health"][:, number], NAMED) & (self.reports["fault"][:, number] == kind)
        return self.reports["fault_size"][named, number]


def watched(name: str, unsaid: str = "") -> Assembly:
    """configs/NAME.toml without the lines that begin with a word, watched for faults."""
    text = (CONFIGS / f"{name}.toml").read_text(encoding="utf-8")
    if unsaid:
        text = "\n".join(line for line in text.split("\n") if not line.startswith(unsaid))
    return assemble(config.parse(text if "\n[faults]" in text else text + WATCHED, name), CONFIGS)


def readings(log: Path, assembly: Assembly, until_s: float = np.inf) -> Records:
    """Every reading of a configured sensor up to a time since the first, in arrival order."""
    given = np.concatenate([chunk.copy() for chunk in open_log(log, assembly.layout)])
    kept: Records = given[given["t_ns"] - given["t_ns"].min() <= until_s * NANOSECONDS]
    return kept


def run(assembly: Assembly, given: Records, *faults: str) -> Told:
    """Run readings through the engine, with these faults injected."""
    lies = list(inject_into([given.copy()], assembly, faults, 0)) if faults else [given.copy()]
    return Told(assembly, assembly.engine().process(np.concatenate(lies)).copy())


def nobody(identity: str, what: str, told: Told) -> Row:
    """The row of a run in which nobody is to be called faulty."""
    named = told.names()
    text = f"sensors called faulty, {what}, nothing injected: {told.said()}; {told.doubts()}"
    return Row(f"10.clean.{identity}", text, len(named), "names", "", None, "0", not named)


def clean_rows(folder: Path, into: Path) -> list[Row]:
    """Recordings in which no sensor lies, and the same with one that does."""
    rows = []
    for name, until_s in CLEAN.items():
        log, assembly = import_from(folder / FOLDERS.get(name, name), name, into), watched(name)
        given = readings(log, assembly, until_s)
        span = "whole" if until_s == np.inf else f"its first {until_s:.0f} s"
        rows.append(nobody(name, f"{name}, {span}", run(assembly, given)))
        if name in INJECTED:
            rows.append(found_row(name, assembly, given))
    return rows


def manoeuvre_rows(folder: Path, into: Path) -> list[Row]:
    """A multi-body car in manoeuvres, told with one track and linear tyres."""
    rows, name = [], "commonroad_maneuvers"
    assembly = watched(name)
    for manoeuvre in MANOEUVRES:
        log = into / f"{manoeuvre}.mcap"
        import_recording(folder / name / f"{manoeuvre}.csv", CONFIGS / "import" / f"{name}.toml", log)
        rows.append(nobody(manoeuvre, f"{name}, {manoeuvre}", run(assembly, readings(log, assembly))))
    return rows


def late_row(folder: Path, into: Path) -> Row:
    """The highway, whose fixes are stamped 0.10 s late, with that delay left out of the configuration."""
    name = "comma2k19"
    assembly = watched(name, "delay_s")
    told = run(assembly, readings(import_from(folder / name, name, into), assembly))
    sizes = np.concatenate([told.sizes(who, Kind.DELAY) for who in ("gnss_position", "gnss_course")])
    size = float(sizes[-1]) if len(sizes) else 0.0
    text = f"{name} with its fixes' delay not configured: named {told.said()}; {told.doubts()}; delay told"
    return Row("10.late", text, size, "s", "", None, "0.10 +- 0.02", abs(size - 0.10) <= 0.02)


def found_row(name: str, assembly: Assembly, given: Records) -> Row:
    """The row of a run in which one sensor is to be called faulty, and nobody else."""
    sensor, fault, since_s, within_s = INJECTED[name]
    told = run(assembly, given, fault)
    named = told.names()
    took_s = named.get((sensor, Kind.BIAS.label), np.inf) - since_s
    text = f"{name} with {fault}: named {told.said()}; time to the name of {sensor}, a bias, and no other"
    ok = len(named) == 1 and 0.0 <= took_s <= within_s
    return Row(f"10.injected.{name}", text, took_s, "s", "", None, f"<= {within_s:g}, no other", ok)


def long_row(folder: Path, into: Path) -> Row:
    """The mower, whose ranges all read 6.9 % long."""
    assembly = watched("plaza2")
    told = run(assembly, readings(import_from(folder / FOLDERS["plaza2"], "plaza2", into), assembly))
    sizes, named = told.sizes("uwb", Kind.SCALE), set(told.names())
    worst = float(np.max(np.abs(sizes - SCALE))) if len(sizes) else np.inf
    text = f"plaza2, ranges 6.9 % long: named {sorted(named)}, the range a scale; worst distance of a size from {SCALE}"
    ok = named == {("uwb", Kind.SCALE.label)} and worst <= SCALE_WITHIN
    return Row("10.plaza2", text, worst, "", "", None, f"<= {SCALE_WITHIN}, no other", ok)


def coverage_row(page: str) -> Row:
    """Lines of a catalogue of faults proven as asked, of all: what falls short is in bold there.

    That the tests which docs/catalogue.md names exist a test of the house checks.
    """
    lines = [line for line in page.splitlines() if line.startswith("| F")]
    open_ = [line for line in lines if "**" in line]
    value, ids = 1.0 - len(open_) / len(lines), sorted({line.split("|")[1].strip() for line in open_})
    text = f"lines of the catalogue of faults proven as asked, of {len(lines)}; not, or not in full: {', '.join(ids)}"
    return Row("10.catalogue", text, value, "of lines", "", None, "1", not open_)


def recordings_part(_: Effort) -> Result:
    """What the recordings' sensors are said to be, and how much of the catalogue is proven."""
    page = (CONFIGS.parent / "docs" / "catalogue.md").read_text(encoding="utf-8")
    result, folder = Result(rows=[coverage_row(page)]), data()
    if not folder.is_dir():
        text = "not measured: no recordings (FUSIOND_DATA names no folder)"
        result.rows.append(Row("10.recordings", text, np.nan, "", "", None, "measured", False))
        return result
    with TemporaryDirectory() as into:
        result.rows += clean_rows(folder, Path(into))
        result.rows += manoeuvre_rows(folder, Path(into))
        result.rows.append(late_row(folder, Path(into)))
        result.rows.append(long_row(folder, Path(into)))
    return result
