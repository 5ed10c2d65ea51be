"""The compiled codec against cantools, over random databases."""

import math
import struct
from dataclasses import dataclass

import numpy as np
import pytest
from cantools.database.can import Message, Signal
from cantools.database.can.formats.dbc.dbc_specifics import DbcSpecifics
from cantools.database.conversion import BaseConversion
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.bus.codec import decode, encode, signal_table
from observer_rt.errors import UserError

EXACT_FLOAT_BITS = 53


@dataclass(frozen=True)
class Attribute:
    """What cantools keeps of a database attribute, as far as the codec reads it."""

    value: int


def make_signal(
    name: str,
    start: int,
    length: int,
    *,
    big_endian: bool = False,
    signed: bool = False,
    is_float: bool = False,
    scale: float = 1,
    offset: float = 0,
    limits: tuple[float, float] | None = None,
    codes: dict[str, int] | None = None,
) -> Signal:
    minimum, maximum = limits if limits is not None else (None, None)
    return Signal(
        name,
        start,
        length,
        byte_order="big_endian" if big_endian else "little_endian",
        is_signed=signed,
        conversion=BaseConversion.factory(scale, offset, None, is_float),
        minimum=minimum,
        maximum=maximum,
        dbc_specifics=DbcSpecifics(attributes={key: Attribute(code) for key, code in (codes or {}).items()}),
    )


def make_message(*signals: Signal, length: int = 64) -> Message:
    return Message(1, "Random", length, list(signals), strict=True)


def dbc_start(first_bit: int, length: int, big_endian: bool) -> int:
    """Start bit in DBC counting of a field over transmitted bits first_bit .. first_bit + length - 1."""
    if big_endian:
        return 8 * (first_bit // 8) + 7 - first_bit % 8
    return first_bit


def numbers(magnitude: float) -> st.SearchStrategy[float]:
    return st.one_of(
        st.integers(-int(magnitude), int(magnitude)),
        st.floats(-magnitude, magnitude, allow_nan=False, allow_subnormal=False),
    )


@st.composite
def messages(draw: st.DrawFn) -> Message:
    """Messages whose signals touch without overlapping. Fields of one byte order share bytes; between two
    byte orders there is a byte boundary, since their bit numbers run in opposite directions."""
    size = draw(st.sampled_from([8, 12, 24, 64]))
    signals: list[Signal] = []
    bit, big_endian = 0, draw(st.booleans())
    while True:
        bit += draw(st.sampled_from([0, 0, 0, 1, 3, 11]))
        if draw(st.booleans()):
            big_endian = not big_endian
            bit = 8 * math.ceil(bit / 8)
        is_float = draw(st.integers(0, 3)) == 0
        length = draw(st.sampled_from([16, 32, 64]) if is_float else st.integers(1, 64))
        if bit + length > 8 * size:
            break
        scale = draw(st.one_of(st.just(1), numbers(1e3)))
        assume(abs(scale) > 1e-6)
        signals.append(
            make_signal(
                f"S{len(signals)}",
                dbc_start(bit, length, big_endian),
                length,
                big_endian=big_endian,
                signed=draw(st.booleans()),
                is_float=is_float,
                scale=scale,
                offset=draw(st.one_of(st.just(0), numbers(1e6))),
            )
        )
        bit += length
    assume(signals)
    return make_message(*signals, length=size)


def decoded(message: Message, payload: bytes, names: list[str] | None = None) -> dict[str, float]:
    names = names or [signal.name for signal in message.signals]
    out = np.zeros(len(names))
    decode(np.frombuffer(payload, np.uint8), signal_table(message, names), out)
    return dict(zip(names, out.tolist(), strict=True))


def encoded(message: Message, values: dict[str, float], payload: bytes | None = None) -> bytes:
    buffer = np.frombuffer(payload or bytes(message.length), np.uint8).copy()
    encode(np.array(list(values.values()), float), signal_table(message, list(values)), buffer)
    return buffer.tobytes()


def same_float(a: float, b: float) -> bool:
    """Equal to the bit, any NaN being like any other."""
    return (math.isnan(a) and math.isnan(b)) or struct.pack("d", a) == struct.pack("d", b)


def exact_in_float64(signal: Signal) -> bool:
    """Whether cantools' arithmetic, which mixes exact integers and floats, is that of float64."""
    if signal.conversion.is_float or (signal.scale == 1 and signal.offset == 0):
        return True
    if signal.conversion.__class__.__name__ == "LinearIntegerConversion":
        largest: int = (1 << signal.length) * abs(signal.scale) + abs(signal.offset)
        return largest <= 1 << EXACT_FLOAT_BITS
    return isinstance(signal.scale, float) or signal.length <= EXACT_FLOAT_BITS


@given(messages(), st.binary(min_size=64, max_size=64))
@settings(max_examples=400, deadline=None)
def test_decode_equals_cantools(message: Message, random_bytes: bytes) -> None:
    payload = random_bytes[: message.length]
    reference = message.decode(payload, decode_choices=False)
    result = decoded(message, payload)
    for signal in message.signals:
        expected, got = float(reference[signal.name]), result[signal.name]
        if exact_in_float64(signal):
            assert same_float(got, expected), signal
        else:
            raw = message.decode(payload, scaling=False)[signal.name]
            largest_term = max(abs(raw * signal.scale), abs(signal.offset))
            assert abs(got - expected) <= 3 * math.ulp(float(largest_term)), signal


@given(messages(), st.data())
@settings(max_examples=400, deadline=None)
def test_encode_equals_cantools(message: Message, data: st.DataObject) -> None:
    values: dict[str, float] = {}
    for signal in message.signals:
        if signal.conversion.is_float:
            raw = data.draw(st.floats(width=signal.length, allow_nan=False, allow_infinity=False))
            value = float(raw * signal.scale + signal.offset)
            limit = {16: 65504.0, 32: 3.4e38, 64: 1.7e308}[signal.length]
            assume(abs(value) < 1e300 and abs(signal.conversion.numeric_scaled_to_raw(value)) <= limit)
        else:
            low = -(1 << (signal.length - 1)) if signal.is_signed else 0
            raw = data.draw(st.integers(low, low + (1 << signal.length) - 1))
            part = data.draw(st.sampled_from([0.0, 0.5, 0.25, -0.5]))
            value = (raw + part) * float(signal.scale) + float(signal.offset)
            assume(low <= signal.conversion.numeric_scaled_to_raw(value) < low + (1 << signal.length))
        values[signal.name] = value
    assert encoded(message, values) == message.encode(values, strict=False)


@given(messages(), st.data(), st.binary(min_size=64, max_size=64))
@settings(max_examples=100, deadline=None)
def test_encode_leaves_the_other_signals_alone(message: Message, data: st.DataObject, before: bytes) -> None:
    before = before[: message.length]
    chosen = data.draw(st.sampled_from(message.signals))
    after = encoded(message, {chosen.name: 1.0}, before)
    raw_before = message.decode(before, scaling=False, decode_choices=False)
    raw_after = message.decode(after, scaling=False, decode_choices=False)
    for signal in message.signals:
        if signal.name != chosen.name:
            assert same_float(raw_before[signal.name], raw_after[signal.name])
    unused = int.from_bytes(make_message_mask(message), "big") ^ ((1 << 8 * message.length) - 1)
    assert int.from_bytes(before, "big") & unused == int.from_bytes(after, "big") & unused


def make_message_mask(message: Message) -> bytes:
    """Ones where the message has signals: what cantools encodes for fields full of ones."""
    fields = [
        make_signal(s.name, s.start, s.length, big_endian=s.byte_order == "big_endian")
        for s in message.signals
    ]
    full = make_message(*fields, length=message.length)
    return bytes(full.encode({s.name: (1 << s.length) - 1 for s in fields}, strict=False))


@given(messages(), st.binary(min_size=64, max_size=64), st.data())
@settings(max_examples=100, deadline=None)
def test_a_flipped_bit_changes_exactly_its_signal(
    message: Message, payload: bytes, data: st.DataObject
) -> None:
    payload = payload[: message.length]
    signal = data.draw(st.sampled_from([s for s in message.signals if not s.conversion.is_float] or [None]))
    assume(signal is not None and signal.length <= EXACT_FLOAT_BITS)
    bit = data.draw(st.integers(0, signal.length - 1))
    field = make_signal("field", signal.start, signal.length, big_endian=signal.byte_order == "big_endian")
    lone = make_message(field, length=message.length).encode({"field": 1 << bit})
    flipped = bytes(a ^ b for a, b in zip(payload, lone, strict=True))
    before, after = decoded(message, payload), decoded(message, flipped)
    changed = [name for name in before if not same_float(before[name], after[name])]
    assert changed == [signal.name]


def sixteen_bit_table(big_endian: bool) -> tuple[Message, NDArray[np.void]]:
    signal = make_signal("Value", dbc_start(20, 16, big_endian), 16, big_endian=big_endian, scale=0.005)
    message = make_message(signal, length=8)
    return message, signal_table(message, ["Value"])


PAYLOAD = bytes.fromhex("0123456789abcdef")


@pytest.mark.parametrize("big_endian", [False, True])
@pytest.mark.parametrize("field", ["step", "first_byte", "shift"])
def test_a_mutated_table_is_told_from_cantools(big_endian: bool, field: str) -> None:
    """Endianness swapped, byte or start bit off by one: each must show in the comparison with cantools."""
    message, table = sixteen_bit_table(big_endian)
    expected = message.decode(PAYLOAD)["Value"]
    out = np.zeros(1)
    decode(np.frombuffer(PAYLOAD, np.uint8), table, out)
    assert out[0] == expected
    if field == "step":
        table["step"] *= -1
    else:
        table[field] += table[field].dtype.type(1)
    decode(np.frombuffer(PAYLOAD, np.uint8), table, out)
    assert out[0] != expected
    buffer = np.zeros(8, np.uint8)
    encode(np.array([expected]), table, buffer)
    assert buffer.tobytes() != message.encode({"Value": expected})


def reserved_codes_signal(*, signed: bool = False, limits: tuple[float, float] | None = None) -> Message:
    codes = {"GenSigSNA": 0x80 if signed else 255, "GenSigError": 0x81 if signed else 254}
    return make_message(
        make_signal("Value", 0, 8, signed=signed, scale=0.5, offset=-10, limits=limits, codes=codes), length=8
    )


@pytest.mark.parametrize(
    ("value", "raw"),
    [(117.5, 253), (117.0, 253), (116.5, 253), (116.0, 252), (1e300, 253), (math.inf, 253), (-math.inf, 0)],
)
def test_no_number_reads_as_not_available_or_error(value: float, raw: int) -> None:
    assert encoded(reserved_codes_signal(), {"Value": value})[0] == raw


@given(st.floats(allow_nan=False), st.booleans())
def test_every_number_comes_back_as_a_number(value: float, signed: bool) -> None:
    message = reserved_codes_signal(signed=signed)
    back = decoded(message, encoded(message, {"Value": value}))["Value"]
    low, high = (-73.0, 53.5) if signed else (-10.0, 116.5)
    assert abs(back - min(max(value, low), high)) <= 0.25


def test_reserved_codes_are_nan() -> None:
    message = reserved_codes_signal()
    assert math.isnan(decoded(message, b"\xff" + bytes(7))["Value"])
    assert math.isnan(decoded(message, b"\xfe" + bytes(7))["Value"])
    assert decoded(message, b"\xfd" + bytes(7))["Value"] == 116.5
    assert encoded(message, {"Value": math.nan})[0] == 255


def test_a_reserved_code_in_the_middle_of_the_range_is_stepped_over() -> None:
    signal = make_signal("Value", 0, 8, codes={"GenSigSNA": 100, "GenSigError": 99})
    message = make_message(signal, length=8)
    raw = [encoded(message, {"Value": value})[0] for value in (98.0, 99.0, 100.0, 101.0)]
    assert raw == [98, 98, 101, 101]


@pytest.mark.parametrize("code", [0x00000000, 0x7F7FFFFF, 0x80000000])
def test_a_reserved_code_of_a_float_is_stepped_over(code: int) -> None:
    signal = make_signal("Value", 0, 32, is_float=True, codes={"GenSigSNA": code})
    message = make_message(signal, length=8)
    (value,) = struct.unpack("<f", struct.pack("<I", code))
    back = decoded(message, encoded(message, {"Value": value}))["Value"]
    assert back == pytest.approx(value, rel=1e-6, abs=1e-40)


def test_declared_limits_clamp() -> None:
    message = reserved_codes_signal(limits=(0.0, 20.2))
    assert encoded(message, {"Value": 50.0})[0] == 60
    assert encoded(message, {"Value": -50.0})[0] == 20


def test_nan_without_a_code_is_the_value_nearest_zero() -> None:
    plain = make_message(make_signal("Value", 0, 8, scale=0.5, offset=-10), length=8)
    assert decoded(plain, encoded(plain, {"Value": math.nan}))["Value"] == 0.0
    above = make_message(make_signal("Value", 0, 8, offset=40), length=8)
    assert decoded(above, encoded(above, {"Value": math.nan}))["Value"] == 40.0
    floating = make_message(make_signal("Value", 0, 32, is_float=True), length=8)
    assert math.isnan(decoded(floating, encoded(floating, {"Value": math.nan}))["Value"])


@pytest.mark.parametrize("length", [16, 32, 64])
def test_floats_too_large_are_clamped_to_the_largest(length: int) -> None:
    message = make_message(make_signal("Value", 0, length, is_float=True), length=8)
    largest = {16: 65504.0, 32: float(np.finfo(np.float32).max), 64: float(np.finfo(np.float64).max)}[length]
    assert decoded(message, encoded(message, {"Value": math.inf}))["Value"] == largest
    assert decoded(message, encoded(message, {"Value": -math.inf}))["Value"] == -largest


def test_half_precision_equals_numpy() -> None:
    message = make_message(make_signal("Value", 0, 16, is_float=True), length=8)
    table, out = signal_table(message, ["Value"]), np.zeros(1)
    for pattern in range(1 << 16):
        payload = np.frombuffer(struct.pack("<Q", pattern), np.uint8)
        decode(payload, table, out)
        assert same_float(out[0], float(np.uint16(pattern).view(np.float16)))


@given(st.floats(-65504, 65504))
def test_half_precision_rounds_like_numpy(value: float) -> None:
    message = make_message(make_signal("Value", 0, 16, is_float=True), length=8)
    expected = int(np.float64(value).astype(np.float16).view(np.uint16))
    assert int.from_bytes(encoded(message, {"Value": value})[:2], "little") == expected


@pytest.mark.parametrize(
    ("signal", "said"),
    [
        (make_signal("Value", 0, 8, scale=0), "scale 0"),
        (make_signal("Value", 0, 8, limits=(300, 400)), "no code"),
        (make_signal("Value", 0, 1, codes={"GenSigSNA": 1, "GenSigError": 0}), "reserved"),
        (make_signal("Value", 0, 8, codes={"GenSigSNA": 256}), "cannot hold"),
    ],
)
def test_unusable_signals_are_refused(signal: Signal, said: str) -> None:
    with pytest.raises(UserError, match=said) as caught:
        signal_table(make_message(signal, length=8), ["Value"])
    assert "Value" in str(caught.value)


def test_multiplexed_signals_are_refused() -> None:
    selector = Signal("Selector", 0, 8, is_multiplexer=True)
    value = Signal("Value", 8, 8, multiplexer_ids=[1], multiplexer_signal="Selector")
    message = make_message(selector, value, length=8)
    with pytest.raises(UserError, match="Value: is multiplexed"):
        signal_table(message, ["Value"])
