"""What an operator may give as an option of a simulation, checked by name.

Each function returns the value it was given, or raises ConfigError with the remedy.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from fusiond.errors import ConfigError


def choice(option: str, given: object, choices: Sequence[str]) -> str:
    """One of some words."""
    if not isinstance(given, str) or given not in choices:
        raise ConfigError(f"simulate: {option} {given!r} is unknown; choose from {', '.join(choices)}")
    return given


def words(option: str, given: object, choices: Sequence[str]) -> tuple[str, ...]:
    """A list of words, each at most once."""
    listed = list(given) if isinstance(given, list | tuple) else [given]
    named = tuple(choice(option, word, choices) for word in listed)
    if len(set(named)) < len(named):
        raise ConfigError(f"simulate: {option} names something twice; name each at most once")
    return named


def number(option: str, given: object, least: float = -math.inf, most: float = math.inf) -> float:
    """A finite number, not below the least nor above the most."""
    if isinstance(given, bool) or not isinstance(given, int | float) or not math.isfinite(given):
        raise ConfigError(f"simulate: {option} {given!r} is no finite number; give one")
    if given < least:
        raise ConfigError(f"simulate: {option} {given} is below {least:g}; give {least:g} or more")
    if given > most:
        raise ConfigError(f"simulate: {option} {given} is above {most:g}; give {most:g} or less")
    return float(given)


def numbers(option: str, given: object, count: int | None = None) -> tuple[float, ...]:
    """A list of finite numbers, 0 or above, as many as asked for where a count is given."""
    if not isinstance(given, list | tuple) or not given:
        raise ConfigError(f"simulate: {option} {given!r} is no list of numbers; write [a, b, ...]")
    if count is not None and len(given) != count:
        raise ConfigError(f"simulate: {option} has {len(given)} numbers, not {count}; give {count}")
    return tuple(number(option, entry, 0.0) for entry in given)


def flag(option: str, given: object) -> bool:
    """True or false."""
    if not isinstance(given, bool):
        raise ConfigError(f"simulate: {option} {given!r} is neither true nor false; give one of them")
    return given
