"""A whole configuration: which sections there are, and on which keys its sensors are heard."""

from __future__ import annotations

from fusiond.config.kinds import AnyControl, AnyModel, AnySensor
from fusiond.config.sections import (
    AdaptationSection,
    FaultsSection,
    FilterSection,
    FusionSection,
    HealthSection,
    HistorySection,
    InitialSection,
    Name,
    RecordingSection,
    Section,
    ServiceSection,
)

RESERVED = ("reference", "applied")
"""Names that stand directly under the namespace, whatever their role."""


class Config(Section):
    """A whole configuration."""

    name: Name
    """What this estimate is called; also names its keys."""
    namespace: str | None = None
    """Prefix of every key; by default fusiond/NAME."""
    model: AnyModel
    """The process model: a built-in kind, or a file of your own."""
    initial: InitialSection
    sensor: dict[Name, AnySensor]
    """Every sensor by its name: a built-in kind, an input, or a file of your own."""
    filter: FilterSection = FilterSection()
    fusion: FusionSection = FusionSection()
    history: HistorySection = HistorySection()
    health: HealthSection = HealthSection()
    faults: FaultsSection | None = None
    """Fault detection; without the section readings are screened and nothing more."""
    adaptation: AdaptationSection | None = None
    """Estimation of noise; without the section R is as declared."""
    control: AnyControl | None = None
    """The control law; without it nothing is commanded."""
    service: ServiceSection = ServiceSection()
    recording: RecordingSection = RecordingSection()

    @property
    def prefix(self) -> str:
        """Prefix of every key."""
        return self.namespace or f"fusiond/{self.name}"

    def key_of(self, name: str) -> str:
        """Key expression on which a sensor's readings come."""
        section = self.sensor.get(name)
        if section is not None and section.key:
            return section.key
        return f"{self.prefix}/{name}" if name in RESERVED else f"{self.prefix}/sensor/{name}"
