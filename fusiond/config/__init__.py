"""What an operator may say: one TOML file, strict and frozen. `fusiond config schema` prints its JSON Schema.

`sections` has the keys, `kinds` those of built-in models, sensors and laws, `whole` puts them together, `reading` reads
a file. What only the models can judge (does this state exist?) is judged in assembly.
"""

from fusiond.config.kinds import parameters
from fusiond.config.reading import nearest, parse, read, schema
from fusiond.config.sections import (
    AdaptationSection,
    ControlSection,
    FaultsSection,
    FilterSection,
    FusionSection,
    FuzzySection,
    InputSection,
    SensorSection,
    ServiceSection,
)
from fusiond.config.whole import RESERVED, Config

__all__ = [
    "RESERVED", "AdaptationSection", "Config", "ControlSection", "FaultsSection", "FilterSection", "FusionSection",
    "FuzzySection", "InputSection", "SensorSection", "ServiceSection", "nearest", "parameters", "parse",
    "read", "schema",
]  # fmt: skip
