"""Fault detection of a configuration: its tests in the design record, and the judge of their alarms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fusiond.assembly.course import rate_hz
from fusiond.assembly.detection import Detection, detection_of, suspects_of, tolerance_of
from fusiond.assembly.moving import is_stationary
from fusiond.assembly.observability import observability
from fusiond.assembly.resolve import Resolved, by_key
from fusiond.config import Config, FaultsSection, FilterSection, FusionSection, InputSection
from fusiond.engine.judge import Judge
from fusiond.engine.layout import Layout
from fusiond.errors import ConfigError
from fusiond.faults.diagnosability import TOLD_APART, shares_left
from fusiond.faults.hypotheses import catalogue
from fusiond.faults.thresholds import ROBUST, SHARP, Promise
from fusiond.types import Role, nanoseconds

SILENT_PERIODS = 2.5
"""Periods without a reading after which a regular stream is silent; an irregular one is given what it needs."""
SILENCE_SHARE = 0.1
"""Part of the promised rate of false alarms that all streams' learnt deadlines together may add to it."""
USUAL_S = 5.0
"""Over how long the usual value of an input is taken."""
PROFILES = {"sharp": SHARP, "robust": ROBUST}


def promise_of(section: FaultsSection) -> Promise:
    """What the operator is promised."""
    dead_band, studentise = PROFILES[section.profile]
    return Promise(section.mean_time_between_false_alarms_s, dead_band, studentise)


def watched(resolved: Resolved, layout: Layout) -> tuple[Layout, Detection | None]:
    """The layout with room for the monitors, and every test's numbers; None where no detection is asked for.

    A plain step has no monitors of its own: it is overseen (`overseen`).
    """
    section = resolved.config.faults
    if section is None:
        return layout, None
    if layout.plain:
        return layout, None
    detection = detection_of(resolved, layout, promise_of(section))
    shape = replace(layout.shape, cells=detection.cells, window=detection.window)
    return replace(layout, shape=shape), detection


def overseen(config: Config) -> Config:
    """The configuration whose compiled engine judges for this one, which has a plain step; raises ConfigError."""
    for name, sensor in config.sensor.items():
        if isinstance(sensor, InputSection) and sensor.without_input_std:
            raise ConfigError(
                f"sensor.{name}.without_input_std: only the compiled step can do without an input; take it out, or "
                "leave filter.recursion and fusion.topology at their defaults"
            )
    bank = FilterSection(accept_unobservable=config.filter.accept_unobservable)
    return config.model_copy(update={"filter": bank, "fusion": FusionSection()})


def obey(design: NDArray[np.void], overseer: NDArray[np.void]) -> None:
    """Write into a plain step's design what it tests itself: the gate, and how long a sensor may be silent."""
    design[0]["tests"]["gate"] = overseer[0]["tests"]["gate"]
    design[0]["silence_ns"] = overseer[0]["silence_ns"]


def write_tests(resolved: Resolved, detection: Detection | None, design: NDArray[np.void]) -> None:
    """Write the thresholds, and what stands in for a missing input, into the design record."""
    record = design[0]
    for number, sensor in enumerate(resolved.sensors):
        section = sensor.section
        if isinstance(section, InputSection) and section.without_input_std:
            subject = f"sensor.{sensor.name}.without_input_std"
            stds = by_key(section.without_input_std, sensor.model.channels, subject)
            for i, slot in enumerate(sensor.model.channels):
                if not stds.get(slot.name, 0.0) > 0.0:
                    raise ConfigError(
                        f"{subject}: `{slot.key}` is missing or 0; say how large the input may be"
                    )
                record["without_var"][number, i] = stds[slot.name] ** 2
    if detection is None:
        return
    for number, sensor in enumerate(resolved.sensors):
        section = sensor.section
        if section is not None and section.rate_hz and section.max_silence_s is None:
            record["silence_ns"][number] = nanoseconds(SILENT_PERIODS / section.rate_hz)
            readings = detection.promise.interval_s * section.rate_hz
            record["promised_gaps"][number] = readings * len(resolved.sensors) / SILENCE_SHARE
    tests = record["tests"]
    cells = detection.cells
    tests["theta"][:cells], tests["limit"][:cells] = detection.cell_theta, detection.cell_h
    tests["tolerance"][:cells] = detection.cell_tolerance
    tests["channel"][:cells], tests["age"][:cells] = detection.cell_channel, detection.cell_age
    tests["kind"][:cells] = detection.cell_kind
    tests["first"], tests["last"] = detection.first, detection.last
    tests["is_input"] = [sensor.role is Role.INPUT for sensor in resolved.sensors]
    tests["gate"] = detection.gate
    tests["variance_limit"], tests["white_limit"] = detection.variance_h, detection.white_h
    if detection.promise.studentise > 0.0:
        tests["white_limit"] = np.inf  # whoever doubts the declared noise has no model to call wrong
        detection = replace(detection, pooled_h=np.full(2, np.inf))
    tests["pooled_limit"], tests["repeat_log"] = detection.pooled_h, detection.repeat_log
    tests["usual_share"] = [
        min(1.0, 1.0 / (USUAL_S * rate_hz(resolved, sensor))) for sensor in resolved.sensors
    ]
    if record["stands_for"] >= 0:
        tests["usual_share"][record["stands_for"]] = 0.0  # the command says what it would be, not its past
    tests["dead_band"], tests["studentise"] = detection.dead_band, detection.studentise


def groups_of(resolved: Resolved) -> list[list[int]]:
    """Numbers of the updating sensors that may share one fault, by the group the configuration names."""
    named: dict[str, list[int]] = {}
    for number, sensor in enumerate(resolved.sensors):
        if sensor.role is Role.UPDATE and sensor.section is not None and sensor.section.group:
            named.setdefault(sensor.section.group, []).append(number)
    return [members for members in named.values() if len(members) > 1]


def twins_of(resolved: Resolved, detection: Detection) -> frozenset[frozenset[int]]:
    """Pairs of updating sensors of which the diagnosability matrix calls a bias of one ambiguous with the other.

    None where the matrix holds for a trial motion alone: how a machine really moves may tell them apart.
    """
    if not is_stationary(resolved):
        return frozenset()
    found = detection.signatures
    own = {suspect.sensor for suspect in found.suspects if not suspect.is_input}
    return frozenset(
        frozenset((suspect.sensor, other))
        for i, suspect in enumerate(found.suspects)
        if suspect.sensor in own
        for other, share in shares_left(found, i).items()
        if other in own and share < TOLD_APART
    )


def judge_of(
    resolved: Resolved, layout: Layout, detection: Detection | None, design: NDArray[np.void]
) -> Judge | None:
    """The judge of the configuration's alarms; None where none is raised."""
    if detection is None:
        return None
    sensors = resolved.sensors
    dofs = {k: sensor.model.dof for k, sensor in enumerate(sensors) if sensor.role is Role.UPDATE}
    inputs = {k: sensor.drives for k, sensor in enumerate(sensors) if sensor.role is Role.INPUT}

    def enough(missing: frozenset[int]) -> bool:
        """Whether the sensors that are left still see every state that must be seen."""
        left = tuple(sensors[k] for k in dofs if k not in missing)
        seen = observability(resolved, left)
        return bool(left) and set(seen.unobserved) <= set(resolved.config.filter.accept_unobservable)

    return Judge(
        layout=layout,
        hypotheses=catalogue(dofs, inputs, groups_of(resolved)),
        enough=enough,
        noise_std=np.array(
            [np.pad(np.sqrt(np.diagonal(s.R)), (0, layout.shape.payload - len(s.R))) for s in sensors]
        ),
        tolerance={suspect: tolerance_of(resolved, suspect) for suspect in suspects_of(resolved)},
        twins=twins_of(resolved, detection),
        policy=tuple(getattr(sensor.section, "policy", "auto") for sensor in sensors),
        silence_ns=np.array(design[0]["silence_ns"]),
        replaceable=tuple(bool(getattr(sensor.section, "without_input_std", None)) for sensor in sensors),
    )
