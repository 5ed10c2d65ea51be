"""The compiled codec against cantools, over random databases."""

import math

import numpy as np
import pytest
from cantools.database.can import Message, Signal
from cantools.database.conversion import BaseConversion
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.bus.database.codec import decode, encode, signal_table
from tests.bus.database.random_databases import numbers, same_float

EXACT_FLOAT_BITS = 53


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
) -> Signal:
    return Signal(
        name,
        start,
        length,
        byte_order="big_endian" if big_endian else "little_endian",
        is_signed=signed,
        conversion=BaseConversion.factory(scale, offset, None, is_float),
    )


def make_message(*signals: Signal, length: int = 64) -> Message:
    return Message(1, "Random", length, list(signals), strict=True)


def dbc_start(first_bit: int, length: int, big_endian: bool) -> int:
    """Start bit in DBC counting of a field over transmitted bits first_bit .. first_bit + length - 1."""
    if big_endian:
        return 8 * (first_bit // 8) + 7 - first_bit % 8
    return first_bit


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


def exact_in_float64(signal: Signal) -> bool:
    """Whether cantools' arithmetic, which mixes exact integers and floats, is that of float64."""
    if signal.conversion.is_float or (signal.scale == 1 and signal.offset == 0):
        return True
    if signal.conversion.__class__.__name__ == "LinearIntegerConversion":
        largest: int = (1 << signal.length) * abs(signal.scale) + abs(signal.offset)
        return largest <= 1 << EXACT_FLOAT_BITS
    return isinstance(signal.scale, float) or signal.length <= EXACT_FLOAT_BITS


@given(messages(), st.binary(min_size=64, max_size=64))
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
