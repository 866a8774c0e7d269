"""The design record of a configuration: every number the step reads, derived once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fusiond.assembly.adapting import adapt_shape, bins_of, fill_noise
from fusiond.assembly.controlling import feeding_sensor, fill_control, queue_room
from fusiond.assembly.initial import initial_covariance
from fusiond.assembly.observability import bears_a_filter
from fusiond.assembly.plain import LOCAL, is_plain
from fusiond.assembly.resolve import Resolved, ResolvedSensor, by_key
from fusiond.assembly.trial import Trial
from fusiond.assembly.turning import fill_turning, guarded_slots
from fusiond.engine.layout import FilterLayout, Layout, SensorLayout
from fusiond.engine.records import Shape, design_dtype
from fusiond.errors import ConfigError
from fusiond.numerics.kernel import interpreted
from fusiond.numerics.ud import ud_factor
from fusiond.types import NANOSECONDS, nanoseconds

DIGITS = 1e10
"""No instrument has more digits than ten: a number of more deviations, and more units, than this is no reading."""
SILENT_PERIODS = 3.0
"""Periods without a reading after which a sensor of known rate is silent, unless the configuration says otherwise."""
SHORTEST_SILENCE_S = 0.1
"""No default is shorter: a busy host holds readings back for tens of milliseconds."""

LONGEST_WAIT_NS = 10 * NANOSECONDS
"""A sensor slower than this is not waited for before a jump of all other clocks is believed."""


def bank_of(resolved: Resolved) -> tuple[FilterLayout, ...]:
    """The bank: all sensors, each left out, and each alone that sees all the configuration asks to be seen."""
    section, updating = resolved.config.filter, resolved.updating
    bank = [FilterLayout("all")]
    if is_plain(resolved.config):
        local = resolved.config.fusion.topology in LOCAL
        return (*bank, *(FilterLayout("only", sensor.name) for sensor in updating if local))
    if len(updating) > 1:
        if section.leave_one_out:
            bank += [FilterLayout("without", sensor.name) for sensor in updating]
        if section.local_filters:
            bank += [
                FilterLayout("only", sensor.name) for sensor in updating if bears_a_filter(resolved, sensor)
            ]
    bank += [FilterLayout("level", updating[0].name) for _ in range(bins_of(resolved))]
    return tuple(bank)


def shape_of(resolved: Resolved, filters: int) -> Shape:
    """Sizes of the configuration's records."""
    process, law = resolved.process, resolved.law
    models = [sensor.model for sensor in resolved.sensors]
    return Shape(
        states=len(process.states),
        errors=len(process.error_slots),
        inputs=len(process.inputs),
        noises=process.noises,
        sensors=len(models),
        filters=filters,
        payload=max(len(model.channels) for model in models),
        slots=max([*(len(model.reads) for model in models), len(law.reads) if law else 0]),
        model_parameters=len(process.parameters),
        sensor_parameters=max(len(model.parameters) for model in models),
        law_parameters=len(law.parameters) if law else 0,
        controls=len(law.controls) if law else 0,
        references=len(law.references) if law else 0,
        guarded=len(guarded_slots(resolved)),
        lazy=int(lags(resolved)),
        memory=law.memory if law else 0,
        queue=queue_room(law.queue) if law and law.plan else 0,
        feeds=int(feeding_sensor(resolved) >= 0),
        adapt=adapt_shape(resolved),
    )


def lags(resolved: Resolved) -> bool:
    """Whether covariances follow more rarely than means; raises ConfigError where that is not to be had."""
    asked = resolved.config.filter.covariance_hz is not None
    if asked and (is_plain(resolved.config) or resolved.process.linear or not resolved.process.inputs):
        raise ConfigError(
            "filter.covariance_hz: only of nonlinear models that inputs drive, in the compiled step; leave it out"
        )
    return asked


def layout_of(resolved: Resolved) -> Layout:
    """Names for the configuration's records."""
    process, law = resolved.process, resolved.law
    sensors = tuple(
        SensorLayout(sensor.name, number, sensor.role, sensor.model.channels)
        for number, sensor in enumerate(resolved.sensors)
    )
    filters = bank_of(resolved)
    return Layout(
        name=resolved.config.name,
        states=process.states,
        errors=process.error_slots,
        outputs=process.outputs,
        inputs=process.inputs,
        controls=law.controls if law else (),
        references=law.references if law else (),
        sensors=sensors,
        filters=filters,
        shape=shape_of(resolved, len(filters)),
        topology=resolved.config.fusion.topology if is_plain(resolved.config) else "",
    )


def factored(P: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """U (unit upper triangular) and d of a covariance known to be positive semi-definite."""
    U, d = np.eye(P.shape[0]), np.zeros(P.shape[0])
    interpreted(ud_factor)(P.copy(), U, d, 1e-9)
    return U, d


def _initial(resolved: Resolved, record: np.record) -> None:
    """Initial state and covariance."""
    process = resolved.process
    record["x0"] = Trial(resolved).initial()
    record["angle"] = [slot.name in process.angles for slot in process.states]
    record["U0"], record["d0"] = factored(initial_covariance(resolved))


def _silence_ns(sensor: ResolvedSensor) -> int:
    """Longest healthy silence; 0 where none is judged."""
    section = sensor.section
    if section is None:
        return 0
    if section.max_silence_s is not None:
        return nanoseconds(section.max_silence_s)
    return nanoseconds(max(SILENT_PERIODS / section.rate_hz, SHORTEST_SILENCE_S)) if section.rate_hz else 0


def _sensor(resolved: Resolved, number: int, record: np.record) -> None:
    """One sensor's tables."""
    sensor = resolved.sensors[number]
    model, section = sensor.model, sensor.section
    dof = model.dof
    U, d = factored(sensor.R)
    record["role"][number] = sensor.role
    record["length"][number] = len(model.channels)
    record["dof"][number] = dof
    record["R_U"][number, :dof, :dof] = U
    record["R_d"][number, :dof] = d
    record["R"][number, :dof] = np.diag(sensor.R)
    record["lower"][number], record["upper"][number] = -np.inf, np.inf
    noise = np.sqrt(np.diag(sensor.R))
    largest = DIGITS * np.maximum(noise, 1.0)
    record["lower"][number, :dof], record["upper"][number, :dof] = -largest, largest
    valid = by_key(section.valid, model.channels, f"sensor.{sensor.name}.valid") if section else {}
    for i, slot in enumerate(model.channels):
        if slot.name in valid:
            lowest, highest = valid[slot.name]
            if not lowest < highest:
                raise ConfigError(
                    f"sensor.{sensor.name}.valid.{slot.key}: nothing lies from {lowest} to {highest}; "
                    f"write [lowest, highest]"
                )
            record["lower"][number, i], record["upper"][number, i] = lowest, highest
        record["wraps"][number, i] = slot.name in model.wraps
    places = {slot.name: place for place, slot in enumerate(resolved.process.states)}
    record["at"][number] = -1
    record["at"][number, : len(model.reads)] = [places[name] for name in model.reads]
    record["sp"][number, : len(model.parameters)] = model.parameters
    record["drives"][number] = -1
    record["drives"][number, : len(sensor.drives)] = sensor.drives
    record["hold"][number] = sensor.hold
    record["holds_value"][number] = section is not None and section.repeats == "held"
    record["delay_ns"][number] = nanoseconds(section.delay_s) if section else 0
    record["silence_ns"][number] = _silence_ns(sensor)


def design_of(resolved: Resolved, layout: Layout) -> NDArray[np.void]:
    """The (1,) design record."""
    design = np.zeros(1, design_dtype(layout.shape))
    record: np.record = design[0]
    process, config = resolved.process, resolved.config
    _initial(resolved, record)
    record["p"][: len(process.parameters)] = process.parameters
    for number, sensor in enumerate(resolved.sensors):
        _sensor(resolved, number, record)
        record["heard"][number] = [row.hears_sensor(sensor.name) for row in layout.filters]
    record["alone"] = [row.hears == "only" for row in layout.filters]
    record["step_ns"] = nanoseconds(process.step_s)
    record["max_step_ns"] = nanoseconds(process.max_step_s)
    record["horizon_ns"] = nanoseconds(config.history.horizon_s)
    record["ahead_ns"] = nanoseconds(config.history.max_ahead_s)
    record["resync"] = config.history.resync_count
    patience_ns = min(int(record["silence_ns"].max()), LONGEST_WAIT_NS)
    record["quiet_ns"] = max(record["horizon_ns"], NANOSECONDS, patience_ns)
    record["dead_reckoning_ns"] = nanoseconds(config.health.dead_reckoning_s)
    record["invalid_ns"] = nanoseconds(config.health.invalid_s)
    fill_control(resolved, record)
    fill_turning(resolved, record)
    fill_noise(resolved, record)
    record["covariance_ns"] = nanoseconds(1.0 / (config.filter.covariance_hz or 1.0))
    return design
