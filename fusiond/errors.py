"""The named errors. An operator's mistake carries `subject: fact, limit, remedy`; a programmer's is a plain exception.

A sensor's mistake is never an exception but a `fusiond.types.Verdict`.
"""

from __future__ import annotations


class FusiondError(Exception):
    """Base of every error raised on purpose; its text is written for the operator."""


class ConfigError(FusiondError):
    """Raised when a configuration cannot be run: misspelt, contradictory or insufficient."""


class LogError(FusiondError):
    """Raised when a recording cannot be read or written."""


class ConnectionFailed(FusiondError):
    """Raised when no session could be opened or no daemon answered."""


class EngineFault(FusiondError):
    """Raised when the compiled step breaks its own contract: a defect of fusiond itself."""
