from __future__ import annotations

import json
import random
import struct
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusiond.assembly.assembly import Assembly
from fusiond.engine.records import HAS_ARRIVAL, HAS_R, HAS_SEQ
from fusiond.service import reading_json, reading_record
from fusiond.service.reading_json import encode_json
from fusiond.service.reading_record import encode_record
from fusiond.service.wire import MOST_BYTES, UNKNOWN, Decoder
from fusiond.types import Verdict

JSON, RECORD = reading_json.ENCODING, reading_record.ENCODING
T_NS = 1_795_315_875_123_456_789


@pytest.fixture
def decoder(assembly: Assembly) -> Decoder:
    return Decoder(assembly.layout)


def decode(decoder: Decoder, payload: bytes | str, encoding: str = JSON, sensor: str = "ultrasonic"):
    """Readings and refusals of one put."""
    decoder.begin()
    decoder.refusals.counts.clear()
    data = payload.encode() if isinstance(payload, str) else payload
    decoder.add(decoder.layout.numbers[sensor], 77, encoding, data)
    return decoder.readings().copy(), dict(decoder.refusals.counts)


def test_a_record_arrives_as_it_was_sent(decoder):
    readings, refused = decode(decoder, encode_record([1.5], T_NS, 2**64 - 1, [0.25]), RECORD)
    assert refused == {}
    (reading,) = readings
    assert (reading.t_ns, reading.seq, reading.arrival_ns, reading.length) == (T_NS, 2**64 - 1, 77, 1)
    assert (reading.z[0], reading.R[0, 0]) == (1.5, 0.25)
    assert reading["flags"] == HAS_ARRIVAL | HAS_SEQ | HAS_R


@given(
    records=st.lists(
        st.tuples(
            st.lists(st.floats(width=64), max_size=4), st.integers(-(2**63), 2**63 - 1), st.integers(0, 2**64 - 1),
            st.booleans(),
        ),
        min_size=1, max_size=6,
    )
)  # fmt: skip
def test_records_in_one_put_equal_records_one_by_one(records, shared_decoder):
    encoded = [encode_record(z, t_ns, seq, z if with_R else None) for z, t_ns, seq, with_R in records]
    together, refused = decode(shared_decoder, b"".join(encoded), RECORD)
    assert refused == {}
    apart = np.concatenate([decode(shared_decoder, one, RECORD)[0] for one in encoded])
    assert together.tobytes() == apart.tobytes()


@pytest.fixture(scope="module")
def shared_decoder(assembly: Assembly) -> Decoder:
    return Decoder(assembly.layout)


def test_many_equal_records_equal_records_one_by_one(decoder):
    encoded = [encode_record([k / 3], T_NS + k, k) for k in range(3000)]
    together, refused = decode(decoder, b"".join(encoded), RECORD)
    apart = np.concatenate([decode(decoder, one, RECORD)[0] for one in encoded])
    assert refused == {}
    assert together.tobytes() == apart.tobytes()


@pytest.mark.parametrize("spoilt", [0, 2, 4])
def test_a_changed_record_is_counted_and_its_neighbours_are_kept(decoder, spoilt):
    encoded = [bytearray(encode_record([float(k)], T_NS, k)) for k in range(5)]
    encoded[spoilt][26] ^= 1
    readings, refused = decode(decoder, b"".join(encoded), RECORD)
    assert refused == {Verdict.BAD_CRC: 1}
    assert [int(r.seq) for r in readings] == [k for k in range(5) if k != spoilt]


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        b"FUS1",
        encode_record([1.0], 0, 0)[:-1],
        encode_record([1.0], 0, 0) + b"x",
        b"FUS2" + encode_record([1.0], 0, 0)[4:],
        struct.pack("<4sBBHQq", b"FUS1", 2, 0, 0, 0, 0) + b"1234",
        struct.pack("<4sBBHQq", b"FUS1", 1, 2, 0, 0, 0) + b"1234",
        struct.pack("<4sBBHQq", b"FUS1", 1, 0, 65535, 0, 0) + b"1234",
    ],
    ids=[
        "empty",
        "magic only",
        "cut",
        "longer",
        "other magic",
        "other version",
        "unknown flag",
        "huge count",
    ],
)
def test_what_is_no_record_is_malformed(decoder, payload):
    _, refused = decode(decoder, payload, RECORD)
    assert refused == {Verdict.MALFORMED: 1}


@pytest.mark.parametrize(
    ("text", "t_ns"),
    [
        ('"t": 1795315875.123456789', T_NS),
        ('"t_ns": 1795315875123456789', T_NS),
        ('"t": 2', 2_000_000_000),
        ('"t": 0.1', 100_000_000),
        ('"t": -1.5e-9', -2),
        ('"t": 1e2', 100_000_000_000),
    ],
)
def test_a_json_time_never_passes_through_a_float(decoder, text, t_ns):
    (reading,), refused = decode(decoder, f'{{{text}, "z": [1]}}')
    assert refused == {}
    assert reading.t_ns == t_ns


def test_json_says_what_a_record_says(decoder):
    by_json, _ = decode(decoder, encode_json([1.5], T_NS, 7, [0.25]))
    by_record, _ = decode(decoder, encode_record([1.5], T_NS, 7, [0.25]), RECORD)
    assert by_json.tobytes() == by_record.tobytes()


def test_json_may_bring_rows_of_a_covariance_names_or_several_readings(decoder):
    (rows,), _ = decode(decoder, '{"t": 1, "z": [1], "R": [[0.5]]}')
    (named,), _ = decode(decoder, '{"t": 1, "values": {"position": 1}}')
    (with_unit,), _ = decode(decoder, '{"t": 1, "values": {"position_m": 1}}')
    several, _ = decode(decoder, '[{"t": 1, "z": [1]}, {"t": 2, "z": [2]}]')
    assert rows.R[0, 0] == 0.5
    assert named.z[0] == with_unit.z[0] == 1.0
    assert several["t_ns"].tolist() == [10**9, 2 * 10**9]


def test_a_reading_that_is_not_finite_or_too_long_is_left_to_the_engine_to_refuse(decoder, assembly):
    several, refused = decode(
        decoder, '[{"t": 1, "z": [NaN]}, {"t": 1, "z": [1e999]}, {"t": 1, "z": [1, 2, 3]}]'
    )
    assert refused == {}
    verdicts = assembly.engine().process(several)["verdict"].tolist()
    assert verdicts == [Verdict.NON_FINITE, Verdict.NON_FINITE, Verdict.WRONG_LENGTH]


@pytest.mark.parametrize(
    "text",
    [
        "", "nonsense", "[]", "{}", "1", "null", '"z"', "[" * 100_000, '{"t": 1}', '{"z": [1]}', '{"t": "1", "z": [1]}',
        '{"t": NaN, "z": [1]}', '{"t": 1e999, "z": [1]}', '{"t": 1e30, "z": [1]}', '{"t": true, "z": [1]}',
        '{"t_ns": 1.0, "z": [1]}', '{"t_ns": 99999999999999999999, "z": [1]}', '{"t": 1, "t_ns": 1, "z": [1]}',
        '{"t": 1, "z": 1}', '{"t": 1, "z": ["1"]}', '{"t": 1, "z": [null]}', '{"t": 1, "z": [true]}',
        '{"t": 1, "z": [[1]]}', '{"t": 1, "z": [1], "seq": -1}', '{"t": 1, "z": [1], "seq": 18446744073709551616}',
        '{"t": 1, "z": [1], "seq": 1.0}', '{"t": 1, "z": [1], "R": [1, 2]}', '{"t": 1, "z": [1], "R": [[1, 2]]}',
        '{"t": 1, "z": [1], "R": 1}', '{"t": 1, "z": [1], "R": ["1"]}', '{"t": 1, "z": [1], "sensr": 1}',
        '{"t": 1, "values": {"speed": 1}}', '{"t": 1, "z": [1' + "0" * 400 + "]}",
        '{"t": 1' + "0" * 5000 + ', "z": [1]}',
        "{" + " " * (MOST_BYTES + 1) + "}",
    ],
)  # fmt: skip
def test_what_is_no_reading_is_malformed(decoder, text):
    readings, refused = decode(decoder, text)
    assert refused == {Verdict.MALFORMED: 1}
    assert len(readings) == 0


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("{", "no JSON, "),
        ('{"t": 1}', "z: not a list of numbers"),
        ('{"t": 1, "z": ["1"]}', "z: not a number"),
        ('{"z": [1]}', "t: no number of seconds"),
        ('{"t": 1, "z": [1], "sensr": 1}', "not an object of R, seq, t, t_ns, values, z alone"),
        ('{"t": 1, "values": {"speed": 1}}', "values.position: not a number"),
    ],
)
def test_the_first_malformed_reading_is_remembered_with_what_is_wrong_in_it(decoder, text, why):
    decode(decoder, text)
    assert decoder.refusals.first[Verdict.MALFORMED].startswith(f"sensor ultrasonic ({why}")


def test_numpy_numbers_are_numbers():
    assert encode_json(np.float32([0.5]), 0, R=np.array([[0.25]])) == (
        '{"t": 0.000000000, "z": [0.5], "R": [[0.25]]}'
    )


def test_bytes_that_are_no_text_and_encodings_nobody_knows_are_malformed(decoder):
    assert decode(decoder, b"\xff\xfe{}")[1] == {Verdict.MALFORMED: 1}
    assert decode(decoder, encode_json([1.0], 0), "application/cdr")[1] == {Verdict.MALFORMED: 1}
    assert decode(decoder, encode_json([1.0], 0), "zenoh/bytes")[1] == {}


def test_a_key_of_no_sensor_is_counted(decoder):
    decoder.add(UNKNOWN, 0, JSON, b"{}")
    assert decoder.refusals.by_name() == {"unknown_sensor": 1}


def test_a_hundred_thousand_bad_payloads_are_counted_and_leave_the_estimate_finite(decoder, assembly):
    """Random, truncated and bit-flipped payloads: each is a reading or counted by reason, none raises."""
    rng = random.Random(0)
    engine = assembly.engine()
    taken = refused = 0
    sound = [encode_json([0.5], T_NS, 3, [0.1]).encode(), encode_record([0.5], T_NS, 3, [0.1])]
    for block in range(100):
        decoder.begin()
        for _ in range(1000):
            encoding = rng.choice([JSON, RECORD])
            decoder.add(rng.choice([0, 1]), block, encoding, spoil(rng, rng.choice(sound)))
        readings = decoder.readings()
        taken += len(readings)
        reports = engine.process(readings)
        assert np.isfinite(reports["x"]).all()
        assert np.isfinite(reports["std"]).all()
    refused = sum(decoder.refusals.counts.values())
    assert taken + refused >= 100_000
    assert refused > 50_000
    assert set(decoder.refusals.counts) == {Verdict.MALFORMED, Verdict.BAD_CRC}


def spoil(rng: random.Random, sound: bytes) -> bytes:
    """One of many ways in which a payload goes wrong; sometimes with a checksum that is right again."""
    data = bytearray(sound)
    match rng.randrange(5):
        case 0:
            return rng.randbytes(rng.randrange(80))
        case 1:
            return bytes(data[: rng.randrange(len(data))])
        case 2:
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        case 3:
            at = rng.randrange(len(data))
            data[at : at + rng.randrange(8)] = rng.randbytes(rng.randrange(8))
        case 4:
            data[8:-4] = rng.randbytes(len(data) - 12)
            data[-4:] = struct.pack("<I", zlib.crc32(data[:-4]))
    return bytes(data)


def test_numbers_keep_every_bit_through_json(decoder):
    value = 0.1 + 0.2
    (reading,), _ = decode(decoder, encode_json([value], T_NS))
    assert reading.z[0] == value
    assert json.loads(encode_json([value], T_NS))["z"] == [value]
