"""Opening foreign recordings: every file becomes rows in its own order, each with the sources that read it."""

from __future__ import annotations

import gzip
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.errors import ConfigError, LogError
from fusiond.recording.importing.mapping import Place, Source
from fusiond.recording.importing.rows import ArrayRow, MessageRow, Row, TextRow
from fusiond.recording.mcap_blocks import McapFile

Rows = Iterator[tuple[Row, Sequence[Source]]]


def rows_of(src: Path, sources: Sequence[Source]) -> list[Rows]:
    """One iterator for each file (or matrix), in the order in which the mapping names them.

    Raises: ConfigError where the mapping names what is not there; LogError where a file cannot be read.
    """
    groups: dict[tuple[str, ...], list[Source]] = {}
    for source in sources:
        groups.setdefault(group_of(source.place), []).append(source)
    return [open_rows(src, members) for members in groups.values()]


def group_of(place: Place) -> tuple[str, ...]:
    """Sources with equal keys share one pass over one file."""
    return (place.file, place.key, place.time_file, place.value_file, place.delimiter, str(place.header))


def open_rows(src: Path, sources: Sequence[Source]) -> Rows:
    """Rows of one file, by what it is."""
    place = sources[0].place
    if place.time_file:
        return pair_rows(located(src, place.time_file), located(src, place.value_file), sources)
    path = located(src, place.file)
    if path.suffix == ".mat":
        return matrix_rows(path, place.key, sources)
    if path.suffix == ".mcap" and speaks_json(path, {s.place.topic for s in sources}):
        return json_rows(path, sources)
    if path.is_dir() or path.suffix in (".bag", ".db3", ".mcap"):
        return bag_rows(path, sources)
    return text_rows(path, sources)


def located(src: Path, name: str) -> Path:
    """A file of SRC: SRC itself without a name, inside SRC where that is a folder, beside it otherwise."""
    path = src if not name else src / name if src.is_dir() else src.parent / name
    if not path.exists():
        raise LogError(f"{path}: is not there; correct SRC or `file` in the mapping")
    return path


def text_rows(path: Path, sources: Sequence[Source]) -> Rows:
    """Lines of a text file, also gzipped; blank ones are skipped."""
    place = sources[0].place
    delimiter = None if place.delimiter == "whitespace" else place.delimiter
    opened = gzip.open if path.suffix == ".gz" else open
    try:
        with opened(path, "rt", encoding="utf-8-sig", errors="replace") as file:
            columns: dict[str, int] = {}
            if place.header:
                columns = {name.strip(): k for k, name in enumerate(file.readline().split(delimiter))}
            for line in file:
                if line.strip():
                    yield TextRow(line.split(delimiter), columns), sources
    except (OSError, EOFError) as error:
        raise LogError(f"{path}: cannot be read ({error}); unpack or copy it again") from error


def matrix_rows(path: Path, key: str, sources: Sequence[Source]) -> Rows:
    """Rows of a matrix in a MAT file."""
    from scipy.io import loadmat

    try:
        content = loadmat(path)
    except Exception as error:
        # scipy passes on whatever the damaged file made it stumble over.
        raise LogError(f"{path}: is no MAT file scipy reads ({error}); save it with -v7") from error
    if key not in content:
        known = ", ".join(name for name in content if not name.startswith("__"))
        raise ConfigError(
            f"sensor.{sources[0].name}.key: {path.name} has no {key!r}, only {known}; name one of them"
        )
    for values in np.atleast_2d(content[key]):
        yield ArrayRow(values), sources


def pair_rows(time_path: Path, value_path: Path, sources: Sequence[Source]) -> Rows:
    """Rows of two numpy files, times (field `t`) and values."""
    t, values = numpy_array(time_path), numpy_array(value_path)
    if len(t) != len(values):
        raise LogError(
            f"{value_path}: has {len(values)} rows for {len(t)} times; name files that belong together"
        )
    for time, row in zip(t, values.reshape(len(values), -1), strict=True):
        yield ArrayRow(row, time), sources


def numpy_array(path: Path) -> NDArray[Any]:
    """A numpy file; pickled objects are not read."""
    try:
        return np.asarray(np.load(path, allow_pickle=False))
    except (OSError, ValueError, EOFError) as error:
        raise LogError(f"{path}: is no numpy file ({error}); name one that numpy.save wrote") from error


def bag_rows(path: Path, sources: Sequence[Source]) -> Rows:
    """Messages of a rosbag 1, a rosbag 2 or a ROS 2 MCAP file, in the order of their record times."""
    from rosbags.highlevel import AnyReader, AnyReaderError
    from rosbags.typesys import Stores, get_typestore

    readers = {
        topic: [s for s in sources if s.place.topic == topic] for topic in {s.place.topic for s in sources}
    }
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as reader:
            check_topics(readers, {c.topic for c in reader.connections}, path)
            connections = [c for c in reader.connections if c.topic in readers]
            for connection, log_time_ns, raw in reader.messages(connections):
                message = reader.deserialize(raw, connection.msgtype)
                yield MessageRow(message, log_time_ns), readers[connection.topic]
    except (AnyReaderError, OSError, KeyError) as error:
        raise LogError(f"{path}: is no recording that rosbags reads ({error}); copy it again") from error


def json_rows(path: Path, sources: Sequence[Source]) -> Rows:
    """JSON messages of an MCAP file, in the order written."""
    readers = {
        topic: [s for s in sources if s.place.topic == topic] for topic in {s.place.topic for s in sources}
    }
    for channel, message in McapFile(path).walk():
        if channel.topic in readers and channel.message_encoding == "json":
            yield MessageRow(parsed(message.data), message.log_time), readers[channel.topic]


def parsed(data: bytes) -> Any:
    """A JSON message, an empty one where it is none: its fields are then missing and it is counted as
    malformed.
    """
    try:
        return json.loads(data)
    except ValueError:
        return {}


def speaks_json(path: Path, topics: set[str]) -> bool:
    """Whether the MCAP file has one of the topics as JSON; raises ConfigError where it has none of them at all."""
    seen: set[str] = set()
    for channel, _ in McapFile(path).walk():
        if channel.topic in topics:
            return channel.message_encoding == "json"
        seen.add(channel.topic)
    check_topics(topics, seen, path)
    return False


def check_topics(wanted: Sequence[str] | set[str] | dict[str, Any], known: set[str], path: Path) -> None:
    """Raises: ConfigError where the recording has not all topics."""
    missing = sorted(set(wanted) - known)
    if missing:
        has = ", ".join(sorted(known))
        raise ConfigError(f"{path.name}: has no topic {', '.join(missing)}, only {has}; correct `topic`")
