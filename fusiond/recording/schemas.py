"""JSON schemas of the channels of a recording, so that viewers (Foxglove) open it without knowing fusiond."""

from __future__ import annotations

import json

TIME = {"type": "number", "description": "time of the message's own clock, s"}
NUMBERS = {"type": "array", "items": {"type": "number"}}
NAMES = {"type": "array", "items": {"type": "string"}}
NAMED = {"type": "object", "additionalProperties": {"type": "number"}}
SEQ = {"type": "integer"}

PROPERTIES: dict[str, dict[str, object]] = {
    "fusiond.Reading": {
        "t": TIME,
        "t_ns": {"type": "integer"},
        "z": NUMBERS,
        "seq": SEQ,
        "arrival_ns": {"type": "integer"},
        "R": {"type": "array", "items": NUMBERS},
    },
    "fusiond.Instant": {"t": TIME, "t_ns": {"type": "integer"}, "arrival_ns": {"type": "integer"}},
    "fusiond.Estimate": {
        "t": TIME, "seq": SEQ, "epoch": {}, "resets": SEQ, "jump": NAMED, "state": NAMED, "std": NAMED,
        "health": {"type": "string"}, "unobserved": NAMES, "protection": {},
    },
    "fusiond.Control": {
        "t": TIME, "seq": SEQ, "epoch": {}, "u": NAMED, "valid": {"type": "boolean"},
        "age_s": {"type": "number"}, "level": {}, "cost": {},
    },
    "fusiond.Health": {
        "t": TIME, "seq": SEQ, "service": {"type": "string"}, "sensors": {"type": "object"},
        "faults": {"type": "object"}, "model": {"type": "boolean"}, "unobserved": NAMES,
    },
    "fusiond.Event": {
        "t": TIME, "t_ns": {"type": "integer"}, "epoch": {}, "id": {}, "sensor": {},
        "from": {"type": "string"}, "to": {"type": "string"}, "fault": {}, "model": {}, "reset": {},
    },
}  # fmt: skip
"""The properties of each message; those without a type may be of several."""

SCHEMA_OF_TOPIC = {
    "estimate": "fusiond.Estimate",
    "smoothed": "fusiond.Estimate",
    "control": "fusiond.Control",
    "health": "fusiond.Health",
    "event": "fusiond.Event",
    "tick": "fusiond.Instant",
    "reset": "fusiond.Instant",
}


def schema_name(topic: str) -> str:
    """The schema of a JSON channel; every `sensor/NAME` carries readings."""
    if topic.startswith("sensor/"):
        return "fusiond.Reading"
    return SCHEMA_OF_TOPIC[topic]


def schema_text(name: str) -> bytes:
    """One schema, as JSON Schema."""
    return json.dumps({"title": name, "type": "object", "properties": PROPERTIES[name]}).encode()
