"""What `fusiond check` prints: everything a configuration implies."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from fusiond.assembly.adapting import adaptation_of
from fusiond.assembly.assembly import Assembly
from fusiond.assembly.detection import Detection, detection_of
from fusiond.assembly.diagnosis import diagnosis_of
from fusiond.assembly.loop_summary import margins_of
from fusiond.assembly.observability import observability, without_each
from fusiond.assembly.watching import promise_of
from fusiond.config import FaultsSection
from fusiond.types import NANOSECONDS, Kind, Role


def _sensor(assembly: Assembly, number: int) -> dict[str, Any]:
    """One sensor: what it sends, what is derived for it."""
    sensor, design = assembly.resolved.sensors[number], assembly.design[0]
    silence_ns = int(design["silence_ns"][number])
    return {
        "name": sensor.name,
        "role": sensor.role.label,
        "key": assembly.config.key_of(sensor.name),
        "channels": [slot.key for slot in sensor.model.channels],
        "max_silence_s": silence_ns / NANOSECONDS if silence_ns else None,
    }


def _thresholds(assembly: Assembly, detection: Detection) -> dict[str, Any]:
    """Every test's threshold, and the promise they were derived from."""
    sensors = assembly.resolved.sensors
    updating = [k for k, sensor in enumerate(sensors) if sensor.role is Role.UPDATE]
    names = [sensor.name for sensor in sensors]
    cells = [
        {
            "sensor": names[int(detection.cell_sensor[c])],
            "channel": int(detection.cell_channel[c]),
            "kind": Kind(int(detection.cell_kind[c])).label,
            "size": float(detection.cell_theta[c]),
            "log_likelihood": float(detection.cell_h[c]),
            "readings": int(detection.cell_age[c]),
        }
        for c in range(0, detection.cells, 2)
    ]
    return {
        "mean_time_between_false_alarms_s": detection.promise.interval_s,
        "tests": detection.tests,
        "gate_nis": {names[k]: float(detection.gate[k]) for k in updating},
        "variance": {names[k]: float(detection.variance_h[k, 0]) for k in updating},
        "lasting": cells,
    }


def summary(assembly: Assembly) -> dict[str, Any]:
    """States, sensors, observability and record sizes, ready for JSON.

    Without a section [faults], `diagnosability` is what its defaults would give, and `thresholds` is empty: nothing is
    tested. Both are empty where the step is not compiled. `margins` is empty without a law that was designed.
    """
    resolved, layout = assembly.resolved, assembly.layout
    detection = assembly.detection or (
        None if layout.plain else detection_of(resolved, layout, promise_of(FaultsSection()))
    )
    whole = observability(resolved, resolved.updating)
    return {
        "name": layout.name,
        "states": [slot.name for slot in layout.states],
        "units": {slot.name: slot.unit for slot in layout.states},
        "outputs": [slot.name for slot in layout.outputs],
        "inputs": [slot.name for slot in layout.inputs],
        "sensors": [_sensor(assembly, number) for number in range(len(resolved.sensors))],
        "observability": {
            **asdict(whole),
            "without": {name: asdict(seen) for name, seen in without_each(resolved).items()},
        },
        "diagnosability": diagnosis_of(resolved, detection) if detection else [],
        "thresholds": _thresholds(assembly, assembly.detection) if assembly.detection else {},
        "adaptation": adaptation_of(resolved),
        "margins": margins_of(resolved),
        "filters": [f"{row.hears} {row.sensor}".strip() for row in layout.filters],
        "bytes": {"track": layout.track.itemsize, "report": layout.report.itemsize},
        "reordered_within_s": resolved.config.history.horizon_s,
    }
