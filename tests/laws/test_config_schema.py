"""The JSON Schema of a configuration: it takes what parsing takes, and refuses what parsing refuses."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path

import pytest

from fusiond.config import parse, schema
from fusiond.errors import ConfigError
from tests.laws.test_config import MISTAKES, TEXT

CONFIGS = sorted((Path(__file__).resolve().parents[2] / "configs").glob("*.toml"))


def fits(value, rule, root):
    """Whether a value fits a JSON Schema: the part of its vocabulary that the schema of a configuration uses."""
    known = {
        "$defs", "$ref", "additionalProperties", "anyOf", "const", "default", "description", "discriminator", "enum",
        "exclusiveMinimum", "items", "maxItems", "minItems", "minimum", "oneOf", "pattern", "properties",
        "propertyNames", "patternProperties", "required", "title", "type",
    }  # fmt: skip
    assert set(rule) <= known, f"the schema says {set(rule) - known}, which this test does not understand"
    if "$ref" in rule:
        return fits(value, root["$defs"][rule["$ref"].rpartition("/")[2]], root)
    for name in ("anyOf", "oneOf"):
        if name in rule:
            matching = sum(fits(value, option, root) for option in rule[name])
            return matching == 1 if name == "oneOf" else matching >= 1
    kinds = {
        "object": dict,
        "array": list,
        "string": str,
        "boolean": bool,
        "integer": int,
        "number": (int, float),
        "null": type(None),
    }
    if "type" in rule and (
        not isinstance(value, kinds[rule["type"]]) or (isinstance(value, bool) != (rule["type"] == "boolean"))
    ):
        return False
    if ("const" in rule and value != rule["const"]) or ("enum" in rule and value not in rule["enum"]):
        return False
    if isinstance(value, list):
        long_enough = rule.get("minItems", 0) <= len(value) <= rule.get("maxItems", len(value))
        return long_enough and all(fits(item, rule.get("items", {}), root) for item in value)
    if isinstance(value, dict):
        return fits_object(value, rule, root)
    if isinstance(value, str):
        return re.search(rule.get("pattern", ""), value) is not None
    if isinstance(value, (int, float)):
        return value >= rule.get("minimum", value) and (
            value > rule["exclusiveMinimum"] if "exclusiveMinimum" in rule else True
        )
    return True


def fits_object(value, rule, root):
    """The same, of an object."""
    properties, patterns = rule.get("properties", {}), rule.get("patternProperties", {})
    rest = rule.get("additionalProperties", True)
    if not set(rule.get("required", ())) <= set(value):
        return False
    for name, item in value.items():
        rules = (
            [properties[name]]
            if name in properties
            else [r for p, r in patterns.items() if re.search(p, name)]
        )
        if not rules and rest is False:
            return False
        if not rules and rest is not True:
            rules = [rest]
        if not fits(name, rule.get("propertyNames", {}), root) or not all(fits(item, r, root) for r in rules):
            return False
    return True


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_the_schema_describes_every_configuration_of_the_project(path):
    told = schema()
    assert fits(tomllib.loads(path.read_text()), told, told)


def test_the_schema_refuses_what_parsing_refuses():
    """Every mistake of form; those of meaning pass the schema and are found when models meet."""
    told = schema()
    assert fits(tomllib.loads(TEXT), told, told)
    seen = 0
    for old, new, _ in MISTAKES.values():
        text = TEXT.replace(old, new, 1)
        try:
            parse(text, "x")
        except ConfigError as error:
            if "not TOML" in str(error) or "nan" in new:
                continue
            assert not fits(tomllib.loads(text), told, told), new
            seen += 1
    assert seen >= 15


def test_the_schema_is_json_and_describes_its_settings():
    told = json.loads(json.dumps(schema()))
    history = told["$defs"]["HistorySection"]["properties"]
    assert all("description" in rule for rule in history.values())
    assert "ahead of the clock" in history["max_ahead_s"]["description"]
