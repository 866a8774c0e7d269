"""Transitions of health in words, as the log has them."""

from __future__ import annotations

from fusiond.recording.fault_words import fault_text
from fusiond.service.health_watch import Transition
from fusiond.types import Health, ServiceHealth

WHY = {
    ServiceHealth.DEGRADED.label: "; a sensor is silent, faulty or not used",
    ServiceHealth.DEAD_RECKONING.label: "; nothing corrected the state within health.dead_reckoning_s",
    ServiceHealth.INVALID.label: "; reset, not finite, or nothing corrected the state within health.invalid_s",
}
MODEL = "; no sensor explains the innovations, the model does not describe what is measured"


def words_of(change: Transition, subject: str, silence_s: float) -> str:
    """One transition.

    Args:
        subject: whose.   silence_s: after which a sensor is silent.
    """
    text = f"{subject}: {change.before} -> {change.after}"
    if change.sensor is None:
        return text + (MODEL if change.model else WHY.get(change.after, ""))
    if change.after == Health.SILENT.label:
        return f"{subject}: silent (limit {silence_s:g} s); withheld until its next reading"
    return text if change.fault is None else f"{text}; {fault_text(change.fault)}"
