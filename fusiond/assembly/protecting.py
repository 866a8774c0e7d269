"""Protection levels of a configuration: which states have one, and the numbers the step needs for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fusiond.assembly.resolve import Resolved
from fusiond.engine.layout import Layout
from fusiond.errors import ConfigError
from fusiond.faults.protection import quantile
from fusiond.models.contract import by_name


def protected(resolved: Resolved, layout: Layout) -> Layout:
    """The layout with room for a level of every state the configuration protects; raises ConfigError."""
    section = resolved.config.faults
    if section is None or not section.protect:
        return layout
    names = section.protect
    try:
        slots = tuple(by_name(layout.errors, name) for name in names)
    except ConfigError as error:
        raise ConfigError(f"faults.protect: {error}") from error
    if len(set(names)) < len(names):
        raise ConfigError(f"faults.protect: {', '.join(names)} names a state twice; name each once")
    if len(resolved.updating) < 2:
        raise ConfigError(
            "faults.protect: only one sensor corrects the state, and nothing limits how wrong it may lead; add another "
            "sensor, or take it out"
        )
    if not resolved.config.filter.leave_one_out:
        raise ConfigError(
            "faults.protect: compares with filters that leave one sensor out each; remove filter.leave_one_out"
        )
    return replace(layout, shape=replace(layout.shape, protected=len(slots)), protected=slots)


def write_protection(resolved: Resolved, layout: Layout, design: NDArray[np.void]) -> None:
    """Write which filters leave a sensor out, the protected slots and their quantile into the design record."""
    section = resolved.config.faults
    if section is None or not layout.protected:
        return
    record = design[0]
    record["spares"] = [row.hears == "without" for row in layout.filters]
    record["protected"] = [layout.errors.index(slot) for slot in layout.protected]
    record["quantile"] = quantile(section.protect_outside)
