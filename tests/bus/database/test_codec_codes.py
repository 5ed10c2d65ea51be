"""Where cantools defines nothing: reserved codes, limits, NaN, and signals that are refused."""

import math
import struct
from typing import Literal

import cantools.database
import numpy as np
import pytest
from cantools.database.can import Message, Signal
from cantools.database.conversion import BaseConversion
from hypothesis import example, given
from hypothesis import strategies as st

from observer_rt.bus.database.codec import signal_table
from observer_rt.core.frames.frames import decode_signals, encode_signals
from observer_rt.foundation.errors import UserError


def message_with(layout: str, codes: dict[str, int] | None = None, value_type: int = 0, more: str = "") -> Message:
    lines = [
        'VERSION ""',
        "BU_: Device",
        "BO_ 1 Message: 8 Device",
        f' SG_ Value : {layout} "" Vector__XXX',
        'BA_DEF_ SG_ "GenSigSNA" INT -2147483648 2147483647;',
        'BA_DEF_ SG_ "GenSigError" INT -2147483648 2147483647;',
        'BA_DEF_DEF_ "GenSigSNA" -1;',
        'BA_DEF_DEF_ "GenSigError" -1;',
        *(f'BA_ "{name}" SG_ 1 Value {code};' for name, code in (codes or {}).items()),
        *([f"SIG_VALTYPE_ 1 Value : {value_type};"] if value_type else []),
        more,
    ]
    return cantools.database.load_string("\n".join(lines) + "\n", "dbc").get_message_by_name("Message")


def float_message(length: int) -> Message:
    return Message(1, "Message", 8, [Signal("Value", 0, length, conversion=BaseConversion.factory(is_float=True))])


def decoded(message: Message, payload: bytes) -> float:
    out = np.zeros(1)
    decode_signals(np.frombuffer(payload, np.uint8), signal_table(message, ["Value"]), out)
    return float(out[0])


def encoded(message: Message, value: float) -> bytes:
    payload = np.zeros(8, np.uint8)
    encode_signals(np.array([value]), signal_table(message, ["Value"]), payload)
    return payload.tobytes()


UNSIGNED = message_with("0|8@1+ (0.5,-10) [0|0]", {"GenSigSNA": 255, "GenSigError": 254})
SIGNED = message_with("0|8@1- (0.5,-10) [0|0]", {"GenSigSNA": -128, "GenSigError": -127})


@example(117.5)
@example(117.0)
@example(math.inf)
@example(-math.inf)
@given(st.floats(allow_nan=False))
def test_every_number_comes_back_as_the_nearest_possible(value: float) -> None:
    """None of them reads as not available, or as an error."""
    for message, low, high in ((UNSIGNED, -10.0, 116.5), (SIGNED, -73.0, 53.5)):
        back = decoded(message, encoded(message, value))
        assert abs(back - min(max(value, low), high)) <= 0.25


@pytest.mark.parametrize(("conversion", "text"), [("1,0", "-0.0"), ("2,0", "0.0"), ("1,-3", "-3.0"), ("2,1", "1.0")])
def test_zero_of_a_float_keeps_its_sign_where_it_passes_as_it_is(conversion: str, text: str) -> None:
    message = message_with(f"0|32@1- ({conversion}) [0|0]", value_type=1)
    assert str(decoded(message, struct.pack("<fi", -0.0, 0))) == text


def test_reserved_codes_are_nan() -> None:
    assert math.isnan(decoded(UNSIGNED, b"\xff" + bytes(7)))
    assert math.isnan(decoded(UNSIGNED, b"\xfe" + bytes(7)))
    assert (decoded(UNSIGNED, b"\xfd" + bytes(7)), encoded(UNSIGNED, math.nan)[0]) == (116.5, 255)
    assert math.isnan(decoded(SIGNED, b"\x80" + bytes(7)))
    assert encoded(SIGNED, math.nan)[0] == 0x80


def test_a_reserved_code_in_the_middle_of_the_range_is_stepped_over() -> None:
    message = message_with("0|8@1+ (1,0) [0|0]", {"GenSigSNA": 100, "GenSigError": 99})
    assert [encoded(message, value)[0] for value in (98.0, 99.0, 100.0, 101.0)] == [98, 98, 101, 101]


@pytest.mark.parametrize("code", [0x00000000, 0x7F7FFFFF, 0x00000001])
def test_a_reserved_code_of_a_float_is_stepped_over(code: int) -> None:
    message = message_with("0|32@1- (1,0) [0|0]", {"GenSigSNA": code}, value_type=1)
    (value,) = struct.unpack("<f", struct.pack("<I", code))
    assert math.isnan(decoded(message, struct.pack("<Q", code)))
    assert decoded(message, encoded(message, value)) == pytest.approx(value, rel=1e-6, abs=1e-40)


@pytest.mark.parametrize(
    ("layout", "expected"),
    [
        ("0|8@1+ (0.5,-10) [0|0]", 0.0),
        ("0|8@1+ (1,40) [0|0]", 40.0),
        ("0|8@1- (1,-300) [0|0]", -173.0),
        ("0|8@1+ (1,0) [5|50]", 5.0),
    ],
)
def test_nan_without_a_code_is_the_value_nearest_zero(layout: str, expected: float) -> None:
    message = message_with(layout)
    assert decoded(message, encoded(message, math.nan)) == expected


@pytest.mark.parametrize(
    ("length", "largest"), [(32, float(np.finfo(np.float32).max)), (64, float(np.finfo(np.float64).max))]
)
def test_floats_keep_nan_and_clamp_infinity(length: int, largest: float) -> None:
    message = float_message(length)
    assert math.isnan(decoded(message, encoded(message, math.nan)))
    assert decoded(message, encoded(message, math.inf)) == largest
    assert decoded(message, encoded(message, -math.inf)) == -largest


def test_a_range_in_which_no_code_lies_says_nothing() -> None:
    message = message_with("0|8@1+ (1,0) [300|400]")
    assert (encoded(message, 77.0)[0], encoded(message, 1e9)[0]) == (77, 255)
    table, values = signal_table(message, ["Value"]), np.empty(1)
    decode_signals(np.frombuffer(b"\x07" + bytes(7), np.uint8), table, values)
    assert values[0] == 7.0


J1939 = 'BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","a","b","J1939PG";\nBA_ "VFrameFormat" BO_ 1 3;'
FAULTS = 'VAL_ 1 Value 65535 "SNA" 65534 "Fault" 65533 "Signal invalid" 7 "seven" ;'


@pytest.mark.parametrize(
    ("layout", "more", "values", "others"),
    [
        ("0|16@1+ (0.5,0) [0|0]", FAULTS, [7, 65532], [65533, 65534, 65535]),
        ("0|16@1+ (0.5,0) [0|0]", J1939, [0, 0xFAFF], [0xFB00, 0xFE00, 0xFFFF]),
        ("0|8@1+ (1,0) [0|0]", J1939, [0, 250], [251, 254, 255]),
        ("0|16@1+ (0.05,0) [0|3200]", "", [0, 64000, 64639], [64641, 65534]),
        ("0|16@1- (0.02,0) [0|1000]", "", [0, -327, 32767], [-328, -32768]),
        ("0|8@1+ (-1,100) [0|100]", "", [0, 100, 101], [102, 255]),
        ("0|4@1+ (1,0) [0|0]", 'VAL_ 1 Value 15 "on" 14 "off" ;', [14, 15], []),
        ("0|8@1+ (1,0) [0|0]", "", [0, 255], []),
    ],
)
def test_codes_that_are_excluded_are_no_values(layout: str, more: str, values: list[int], others: list[int]) -> None:
    message = message_with(layout, more=more)
    for codes, is_value in ((values, True), (others, False)):
        for code in codes:
            assert math.isnan(decoded(message, struct.pack("<q", code))) != is_value, code
    for value in (math.inf, -math.inf, 1e9):
        assert not math.isnan(decoded(message, encoded(message, value)))


@pytest.mark.parametrize(("more", "largest"), [(FAULTS, 65532), (J1939, 0xFAFF), ("", 65535)])
def test_codes_that_a_range_alone_excludes_end_where_those_begin_that_are_no_values(more: str, largest: int) -> None:
    assert signal_table(message_with("0|16@1+ (1,0) [0|9]", more=more), ["Value"])["largest"][0] == largest


def test_of_a_counter_every_code_counts() -> None:
    table, out = (signal_table(message_with("0|8@1+ (1,0) [0|100]", more=J1939), ["Value"], "Value"), np.zeros(1))
    decode_signals(np.full(8, 255, np.uint8), table, out)
    assert out[0] == 255.0


@pytest.mark.parametrize(
    ("message", "said"),
    [
        (message_with("0|8@1+ (0,0) [0|0]"), "scale 0"),
        (message_with("0|1@1+ (1,0) [0|0]", {"GenSigSNA": 1, "GenSigError": 0}), "reserved"),
        (message_with("0|8@1+ (1,0) [0|0]", {"GenSigSNA": 256}), "cannot hold"),
        (float_message(24), "float of 24 bits"),
    ],
)
def test_unusable_signals_are_refused(message: Message, said: str) -> None:
    with pytest.raises(UserError, match=f"Value: .*{said}"):
        signal_table(message, ["Value"])


@pytest.mark.parametrize(
    ("start", "length", "order"), [(60, 8, "little_endian"), (56, 16, "big_endian"), (70, 1, "little_endian")]
)
def test_signals_beyond_are_refused(start: int, length: int, order: Literal["little_endian", "big_endian"]) -> None:
    """A database read leniently may have them; decoding them would read foreign memory."""
    value = Signal("Value", start, length, byte_order=order)
    with pytest.raises(UserError, match="Value: does not fit in the 8 bytes"):
        signal_table(Message(1, "Message", 8, [value], strict=False), ["Value"])
