"""Reading a configuration: TOML to `Config`, and everything wrong with its form as lines an operator can act on."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from fusiond.config.kinds import LAW_SECTIONS, PROCESS_SECTIONS, SENSOR_SECTIONS
from fusiond.config.sections import (
    AdaptationSection,
    FaultsSection,
    FilterSection,
    FusionSection,
    FuzzySection,
    HealthSection,
    HistorySection,
    InitialSection,
    InputSection,
    RecordingSection,
    Section,
    ServiceSection,
)
from fusiond.config.whole import Config
from fusiond.errors import ConfigError


def _known_names() -> set[str]:
    """Every name that can stand before an equals sign."""
    sections: list[type[Section]] = [
        *PROCESS_SECTIONS.values(), *SENSOR_SECTIONS.values(), *LAW_SECTIONS.values(), Config, InputSection,
        InitialSection, FilterSection, FusionSection, HistorySection, HealthSection, FaultsSection, AdaptationSection,
        FuzzySection, ServiceSection, RecordingSection,
    ]  # fmt: skip
    return {name for section in sections for name in section.model_fields}


def nearest(word: str, known: Iterable[str]) -> str:
    """`; did you mean ...?` for a misspelt word, or what there is to choose from."""
    choices = sorted(known)
    if not choices:
        return "there is none to name"
    near = difflib.get_close_matches(word, choices, 1, 0.6)
    near = near or [choice for choice in choices if choice.startswith(f"{word}_")]
    meant = " or ".join(f"`{choice}`" for choice in near)
    return f"did you mean {meant}?" if near else f"choose from {', '.join(choices)}"


def _explain(error: Mapping[str, Any]) -> str:
    """One pydantic error as `subject: fact; remedy`."""
    tags = {*PROCESS_SECTIONS, *SENSOR_SECTIONS, *LAW_SECTIONS, "input", "file"}
    path = [str(part) for part in error["loc"] if part != "[key]"]
    subject = ".".join(
        part for i, part in enumerate(path) if not (part in tags and path[i - 1 : i] != ["sensor"])
    )
    match error["type"]:
        case "extra_forbidden":
            known = set(Config.model_fields) if len(path) == 1 else _known_names()
            near = difflib.get_close_matches(path[-1], sorted(known), 1, 0.6)
            hint = (
                f"did you mean `{near[0]}`?"
                if near
                else "remove it; `fusiond config schema` lists what there is"
            )
            return f"{subject}: unknown key; {hint}"
        case "missing":
            return f"{subject}: is missing; add it (`fusiond config schema` describes it)"
        case "union_tag_invalid" | "union_tag_not_found":
            given = error.get("ctx", {}).get("tag", "nothing")
            kinds = {"model": [*PROCESS_SECTIONS], "sensor": [*SENSOR_SECTIONS, "input"]}
            choices = kinds.get(path[0], [*LAW_SECTIONS])
            if given == "None":
                tag = "kind" if path[0] in kinds else "law"
                return f"{subject}: `{tag}` is missing; choose from {', '.join(sorted(choices))}"
            return f"{subject}: no kind `{given}`; {nearest(str(given), choices)}"
        case "string_pattern_mismatch":
            return f"{subject}: {error['input']!r} is no name; write lower-case letters, digits and _, a letter first"
        case _:
            fact = error["msg"].removeprefix("Input ")
            return f"{subject}: {fact}, got {error['input']!r}; `fusiond config schema` describes it"


def parse(text: str, source: str) -> Config:
    """Read a configuration from TOML text; raises ConfigError that lists everything wrong with its form."""
    try:
        return Config.model_validate(tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{source}: not TOML ({error}); correct the line it names") from error
    except ValidationError as error:
        lines = [_explain(one) for one in error.errors(include_url=False)]
        raise ConfigError("\n".join(f"{source}: {line}" for line in lines)) from error


def read(path: Path) -> Config:
    """Read a configuration file; raises ConfigError."""
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: cannot be read as text; give the path of a TOML configuration") from error
    except OSError as error:
        reason = error.strerror
        raise ConfigError(
            f"{path}: cannot be read ({reason}); give the path of a TOML configuration"
        ) from error
    return parse(text, str(path))


def schema() -> dict[str, Any]:
    """JSON Schema of a configuration."""
    return Config.model_json_schema()
