"""The mapping file: which numbers of a foreign recording are which sensor's, and how they become SI.

    time = "stamp"                      # defaults for every sensor; each may say otherwise
    time_unit = "s"

    [sensor.gps]
    file = "drive.csv"                  # inside SRC, where SRC is a folder
    on_change = true                    # only rows whose values differ from the last
    values = [
        { name = "x", unit = "m", east_of = ["latitude", "longitude"] },
        { name = "y", unit = "m", north_of = ["latitude", "longitude"] },
    ]

Where a row comes from: `file`; `topic` (bags, MCAP); `key` (MAT); `time_file` and `value_file` (numpy pairs);
`delimiter` ("," or "whitespace") and `header` for text; `where = { column = 0, equals = "L" }`.
When it was: `time` (column, index, dotted field, or "log_time") with `time_unit`, the same for `arrival`, and
`seq`. With `every_s`, rows are samples of a steady clock, that many seconds apart from the first row's `time` on:
for a logger that stamps rows when it writes them.
A value is `from` a column, index or dotted field (scale, offset, convert, wrap), `east_of` / `north_of` a
latitude and a longitude in degrees, or `roll_of`, `pitch_of`, `yaw_of` (z-y-x angles) a quaternion
[x, y, z, w] from body to world, or `forward_of`
/ `left_of` a velocity [x, y, z] of the body: what is left of it in the horizontal plane, ahead and to the
left, by the newest orientation of the table [attitude] (`quaternion = [x, y, z, w]`, a place and a clock).
`mean_of` columns is their mean; `ecef_east_of`, `ecef_north_of` and `ecef_altitude_of` are of an earth-fixed position
[x, y, z], m, in the same plane as `east_of`, and above the ellipsoid. With `per_s` a number was gained since the
source's row before (encoder counts, a turn): it is divided by the time between, and the first row has none.
Fields that are not in degrees or the like are multiplied by `field_scale` first (1e-7 for latitudes in 1e-7 deg).

`[truth]` (or several `[[truth]]`) is written like a sensor, with names of states or outputs; `[origin]` has
the latitude and longitude, deg, that east and north count from (without it the first position).
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fusiond.engine.layout import Layout, SensorLayout
from fusiond.engine.records import Shape
from fusiond.errors import ConfigError
from fusiond.recording.decimal_time import DIGITS
from fusiond.types import NANOSECONDS, Role, Slot

Field = str | int
"""A column's name, a column's or element's index, or a dotted field of a message."""

PLACE = {"file", "topic", "key", "time_file", "value_file", "delimiter", "header", "where"}
CLOCK = {"time", "time_unit", "every_s", "arrival", "arrival_unit", "seq"}
KINDS = {
    "from": 1, "east_of": 2, "north_of": 2, "roll_of": 4, "pitch_of": 4, "yaw_of": 4, "forward_of": 3, "left_of": 3,
    "ecef_east_of": 3, "ecef_north_of": 3, "ecef_altitude_of": 3, "mean_of": 0,
}  # fmt: skip
"""What a number is made of, and of how many fields; 0 for any number of them."""
VALUE = {"name", "unit", "field_scale", "scale", "offset", "convert", "wrap", "per_s", *KINDS}
ATTITUDE = "attitude"
"""Name of the source that gives the body's orientation; no sensor may have it."""
CONVERSIONS = ("deg_to_rad", "km_h_to_m_s", "course_deg_to_yaw_rad")


@dataclass(frozen=True, slots=True)
class Value:
    """One number of a reading. `kind` is one of KINDS, `fields` what it is made of, each times `field_scale`."""

    name: str
    unit: str
    kind: str
    fields: tuple[Field, ...]
    scale: float
    offset: float
    convert: str
    wrap: bool
    field_scale: float = 1.0
    per_s: bool = False


@dataclass(frozen=True, slots=True)
class Place:
    """Where rows come from: everything that says which rows, and how to read them."""

    file: str
    topic: str
    key: str
    time_file: str
    value_file: str
    delimiter: str
    header: bool
    where: tuple[Field, str] | None


@dataclass(frozen=True, slots=True)
class Source:
    """One sensor, or the truth: a place, a clock and values. `every_ns` is 0 where each row's time is its own."""

    name: str
    place: Place
    time: Field
    time_unit: str
    every_ns: int
    arrival: Field | None
    arrival_unit: str
    seq: Field | None
    values: tuple[Value, ...]
    on_change: bool


@dataclass(frozen=True, slots=True)
class ImportMapping:
    """A whole mapping file; sensors in its order."""

    sensors: tuple[Source, ...]
    truth: tuple[Source, ...] = ()
    attitude: Source | None = None
    """Orientation of the body, for velocities that are levelled; its only value is the quaternion."""
    origin_deg: tuple[float, float] | None = None

    def layout(self, name: str) -> Layout:
        """A layout that has only sensors, numbered in the mapping's order."""
        payload = max(len(sensor.values) for sensor in self.sensors)
        sensors = tuple(
            SensorLayout(s.name, number, Role.UPDATE, tuple(Slot(v.name, v.unit) for v in s.values))
            for number, s in enumerate(self.sensors)
        )
        shape = Shape(
            states=0, errors=0, inputs=0, noises=0, sensors=len(sensors), filters=0, payload=payload, slots=0,
            model_parameters=0, sensor_parameters=0, law_parameters=0, controls=0, references=0,
        )  # fmt: skip
        return Layout(
            name,
            states=(),
            errors=(),
            outputs=(),
            inputs=(),
            controls=(),
            references=(),
            sensors=sensors,
            filters=(),
            shape=shape,
        )


def read_mapping(path: Path) -> ImportMapping:
    """Read a mapping file. Raises: ConfigError where it is missing, no TOML, or says what nobody understands."""
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(
            f"{path}: cannot be read ({error.strerror}); name an existing mapping file"
        ) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path.name}: is no TOML ({error}); correct it") from error
    return mapping_of(content, path.name)


def mapping_of(content: Mapping[str, Any], subject: str) -> ImportMapping:
    """The same from parsed TOML."""
    check_keys(content, PLACE | CLOCK | {"sensor", "truth", "origin", "attitude"}, subject)
    defaults = {key: value for key, value in content.items() if key in PLACE | CLOCK}
    sensors = content.get("sensor", {})
    if not isinstance(sensors, dict) or not sensors:
        raise ConfigError(f"{subject}: maps no sensor; add a table [sensor.NAME]")
    if ATTITUDE in sensors:
        raise ConfigError(
            f"{subject}: sensor.{ATTITUDE}: the name is taken by the table [{ATTITUDE}]; choose another"
        )
    sources = tuple(
        source_of(name, defaults | table, f"{subject}: sensor.{name}") for name, table in sensors.items()
    )
    origin = content.get("origin")
    attitude = attitude_of(content.get("attitude"), defaults, f"{subject}: attitude")
    levelled = any(v.kind in ("forward_of", "left_of") for s in sources for v in s.values)
    if levelled and attitude is None:
        raise ConfigError(
            f"{subject}: forward_of and left_of need an orientation; add [attitude] with a quaternion"
        )
    return ImportMapping(
        sources,
        truth_of(content.get("truth", ()), defaults, subject),
        attitude,
        None if origin is None else origin_of(origin, f"{subject}: origin"),
    )


def attitude_of(table: Mapping[str, Any] | None, defaults: Mapping[str, Any], subject: str) -> Source | None:
    """The table [attitude]: a place, a clock and `quaternion`."""
    if table is None:
        return None
    if "quaternion" not in table:
        raise ConfigError(
            f"{subject}: has no quaternion; add `quaternion = [x, y, z, w]`, four columns or fields"
        )
    rest = {key: value for key, value in table.items() if key != "quaternion"}
    values = [{"name": ATTITUDE, "yaw_of": table["quaternion"]}]
    return source_of(ATTITUDE, {**defaults, **rest, "values": values}, subject)


def truth_of(tables: Any, defaults: Mapping[str, Any], subject: str) -> tuple[Source, ...]:
    """The table [truth], or several of them ([[truth]]) where it stands in rows of several kinds."""
    tables = [tables] if isinstance(tables, dict) else tables
    sources = tuple(source_of("truth", defaults | table, f"{subject}: truth") for table in tables)
    if len({tuple(value.name for value in source.values) for source in sources}) > 1:
        raise ConfigError(
            f"{subject}: truth: its tables name different values; name the same in the same order"
        )
    return sources


def origin_of(table: Mapping[str, Any], subject: str) -> tuple[float, float]:
    """Latitude and longitude, deg, of the point that east and north count from."""
    check_keys(table, {"latitude", "longitude"}, subject)
    try:
        return float(table["latitude"]), float(table["longitude"])
    except (KeyError, TypeError, ValueError) as error:
        raise ConfigError(
            f"{subject}: needs latitude and longitude in degrees; or leave it out for the first fix"
        ) from error


def source_of(name: str, table: Mapping[str, Any], subject: str) -> Source:
    """One sensor's table, defaults included."""
    check_keys(table, PLACE | CLOCK | {"values", "on_change"}, subject)
    if "time" not in table:
        raise ConfigError(
            f'{subject}: says no time; add `time`, the column or field of its clock (bags: "log_time")'
        )
    units = {key: table.get(key, "s") for key in ("time_unit", "arrival_unit")}
    for key, unit in units.items():
        if unit not in DIGITS:
            raise ConfigError(
                f"{subject}.{key}: {unit!r} is no unit of time here; write one of {', '.join(DIGITS)}"
            )
    every_s = table.get("every_s", 0.0)
    if not isinstance(every_s, int | float) or not 0.0 <= every_s < float("inf"):
        raise ConfigError(f"{subject}.every_s: {every_s!r} is no period; write seconds, or leave it out")
    values = tuple(value_of(v, f"{subject}.values[{k}]") for k, v in enumerate(table.get("values", ())))
    if not values:
        raise ConfigError(
            f"{subject}: has no values; add `values = [{{ name = ..., unit = ..., from = ... }}]`"
        )
    return Source(
        name, place_of(table, subject), table["time"], units["time_unit"], round(every_s * NANOSECONDS),
        table.get("arrival"), units["arrival_unit"], table.get("seq"), values, bool(table.get("on_change", False)),
    )  # fmt: skip


def place_of(table: Mapping[str, Any], subject: str) -> Place:
    """Where rows come from."""
    where = table.get("where")
    if where is not None:
        check_keys(where, {"column", "equals"}, f"{subject}.where")
        if not {"column", "equals"} <= where.keys():
            raise ConfigError(f"{subject}.where: needs `column` and `equals`; add what is missing")
        where = (where["column"], str(where["equals"]))
    if ("time_file" in table) != ("value_file" in table):
        raise ConfigError(f"{subject}: time_file and value_file only make sense together; add the other")
    texts = {key: str(table.get(key, "")) for key in ("file", "topic", "key", "time_file", "value_file")}
    return Place(
        **texts,
        delimiter=str(table.get("delimiter", ",")),
        header=bool(table.get("header", True)),
        where=where,
    )


def value_of(table: Any, subject: str) -> Value:
    """One entry of `values`."""
    if not isinstance(table, dict):
        raise ConfigError(f"{subject}: is no table; write {{ name = ..., unit = ..., from = ... }}")
    check_keys(table, VALUE, subject)
    kinds = [kind for kind in KINDS if kind in table]
    if len(kinds) != 1:
        raise ConfigError(
            f"{subject}: says {' and '.join(kinds) or 'no source'}; write one of {', '.join(KINDS)}"
        )
    kind = kinds[0]
    raw = table[kind]
    fields = tuple(raw) if isinstance(raw, list) else (raw,)
    needed = KINDS[kind]
    counted = len(fields) == needed if needed else bool(fields)
    if not counted or not all(isinstance(f, str | int) for f in fields):
        raise ConfigError(
            f"{subject}.{kind}: {raw!r} is not {needed or 'a list of'} column(s); name them, or count from 0"
        )
    convert = table.get("convert", "")
    if convert and convert not in CONVERSIONS:
        raise ConfigError(f"{subject}.convert: {convert!r} is unknown; write one of {', '.join(CONVERSIONS)}")
    if "name" not in table:
        raise ConfigError(f"{subject}: has no name; add `name` and `unit` of the number as it comes out")
    numbers = {
        key: table.get(key, default)
        for key, default in (("field_scale", 1.0), ("scale", 1.0), ("offset", 0.0))
    }
    if not all(isinstance(n, int | float) for n in numbers.values()):
        raise ConfigError(f"{subject}: field_scale, scale and offset are numbers; correct {numbers}")
    return Value(
        str(table["name"]), str(table.get("unit", "")), kind, fields,
        float(numbers["scale"]), float(numbers["offset"]), convert, bool(table.get("wrap", False)),
        float(numbers["field_scale"]), bool(table.get("per_s", False)),
    )  # fmt: skip


def check_keys(table: Mapping[str, Any], known: set[str], subject: str) -> None:
    """Raises: ConfigError for a key nobody reads."""
    odd = sorted(set(table) - known)
    if odd:
        raise ConfigError(
            f"{subject}: nobody reads {', '.join(odd)}; write one of {', '.join(sorted(known))}"
        )
