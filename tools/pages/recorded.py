"""Recordings nobody here made, imported with their mapping files and run with their configurations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.assembly.assembly import Assembly, load
from fusiond.recording.importing import import_recording
from fusiond.recording.log import open_log
from fusiond.recording.replay import replay
from fusiond.recording.summary import Summary
from fusiond.recording.truth import Truth, read_truth, wrapped
from fusiond.types import NANOSECONDS, Role, Verdict

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
SOURCES = {
    "commonroad_maneuvers": "dlc_60kmh.csv",
    "jackal": "test2.bag",
    "dresden_car": "2014-03-26-000-Data.csv",
    "udacity_laser_radar": "obj_pose-laser-radar-synthetic-ekf-input.txt",
    "jackal_3d": "test2.bag",
    "px4_iris": "iris_gps_input.csv",
    "plaza2": "Plaza2_.mat",
    "comma2k19": ".",
}
"""What is imported with configs/import/NAME.toml, in the recording's own folder."""
FOLDERS = {"jackal_3d": "jackal", "plaza2": "plaza2_uwb_mower"}
"""The recording's folder where it is not called NAME."""
Records = NDArray[Any]
Floats = NDArray[np.float64]


def import_from(folder: Path, name: str, into: Path) -> Path:
    """Import a recording with its mapping file; its truth, where there is one, comes to lie beside the log.

    Args:
        folder: the recording's own.   name: of the mapping, a key of SOURCES.   into: folder for the log.
    """
    log = into / f"{name}.mcap"
    import_recording(folder / SOURCES[name], CONFIGS / "import" / f"{name}.toml", log)
    return log


@dataclass(frozen=True)
class Recorded:
    """A log and the configuration it is run with."""

    assembly: Assembly
    log: Path

    @cached_property
    def readings(self) -> Records:
        """Every reading of a configured sensor, in arrival order."""
        return np.concatenate([chunk.copy() for chunk in open_log(self.log, self.assembly.layout)])

    @cached_property
    def t_s(self) -> Floats:
        """Stamps since the first one."""
        since: NDArray[np.int64] = self.readings["t_ns"] - self.readings["t_ns"].min()
        return np.asarray(since / NANOSECONDS)

    @cached_property
    def reports(self) -> Records:
        """One report a reading, of a run over all of them."""
        return self.assembly.engine().process(self.readings).copy()

    @cached_property
    def truth(self) -> Truth | None:
        """The recording's own, None where it has none."""
        path = self.log.with_suffix(".truth.csv")
        return read_truth(path, ("yaw", "course")) if path.is_file() else None

    def of(self, sensor: str) -> NDArray[np.bool_]:
        """Which readings are this sensor's."""
        return np.asarray(self.readings["sensor"] == self.assembly.layout.numbers[sensor])

    def used(self, sensor: str) -> NDArray[np.bool_]:
        """Which of this sensor's readings conditioned the state."""
        return np.asarray(self.of(sensor) & (self.reports["verdict"] == Verdict.USED))

    def run(self, keep: Callable[[Records], NDArray[np.bool_]] | None = None) -> Summary:
        """`fusiond replay` of the log, with its truth.

        Args:
            keep: which readings of a chunk are let through; all without it.
        """
        source = open_log(self.log, self.assembly.layout)
        chunks = source if keep is None else (chunk[keep(chunk)] for chunk in source)
        return replay(self.assembly.engine(), chunks, truth=self.truth, refusals=source.refusals)


def recorded(config: str, log: Path) -> Recorded:
    """A log with configs/CONFIG.toml."""
    return Recorded(load(CONFIGS / f"{config}.toml"), log)


def errors(
    run: Recorded, reports: Records, names: Sequence[str], after_s: float = 0.0
) -> tuple[Floats, Floats]:
    """Estimate minus truth after each reading that conditioned the state, angles on the circle.

    Truth is interpolated to the time of the state, as `fusiond replay --truth` does.

    Args:
        reports: of the run, or of the same recording with readings left out or another configuration.
        names: of states that the truth has, k of them.   after_s: since the first reading.
    Returns:
        (rows,) time since the first reading, s; (rows, k) in the units of the states.
    """
    truth, layout = run.truth, run.assembly.layout
    assert truth is not None
    updating = [sensor.number for sensor in layout.sensors if sensor.role is Role.UPDATE]
    kept = reports[np.isin(reports["sensor"], updating) & (reports["verdict"] == Verdict.USED)]
    true, covered = truth.at(kept["state_t_ns"])
    t_s = (kept["state_t_ns"] - run.readings["t_ns"].min()) / NANOSECONDS
    rows = covered & (t_s >= after_s)
    states = [slot.name for slot in layout.states]
    apart = kept["x"][:, [states.index(name) for name in names]]
    apart = (apart - true[:, [truth.names.index(name) for name in names]])[rows]
    circular = [name == "yaw" for name in names]
    apart[:, circular] = wrapped(apart[:, circular])
    return np.asarray(t_s[rows]), np.asarray(apart)


def rms_length(apart: Floats) -> float:
    """Root of the mean square of the length of each row."""
    return float(np.sqrt(np.mean(np.sum(apart**2, axis=1))))


def fix_residuals_m(run: Recorded, sensor: str = "gps") -> Floats:
    """Distance of the estimate from each new fix, once it is taken into account."""
    at = run.used(sensor)
    apart: Floats = run.reports["x"][at, :2] - run.readings["z"][at, :2]
    return np.hypot(apart[:, 0], apart[:, 1])


def outage_m(run: Recorded, from_s: float, to_s: float, sensor: str = "gps") -> float:
    """Distance from the last fix that was withheld, where all from `from_s` up to `to_s` are.

    The state is that of the fix's own time: nothing later has been taken into account.
    """
    withheld = run.used(sensor) & (run.t_s >= from_s) & (run.t_s < to_s)
    last = run.readings[withheld][-1]
    begin_ns, number = run.readings["t_ns"].min(), run.assembly.layout.numbers[sensor]

    def keep(chunk: Records) -> NDArray[np.bool_]:
        late = chunk["t_ns"] - begin_ns >= from_s * NANOSECONDS
        kept: NDArray[np.bool_] = (chunk["t_ns"] <= last["t_ns"]) & ~((chunk["sensor"] == number) & late)
        return kept

    state = run.run(keep).final["state"]
    return float(np.hypot(state["x"] - last["z"][0], state["y"] - last["z"][1]))
