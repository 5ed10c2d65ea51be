"""The compiled codec against cantools, over random databases that are read as a user's are."""

import math
import struct

import numpy as np
from cantools.database.can import Message, Signal
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from observer_rt.bus.database.codec import signal_table
from observer_rt.bus.database.multiplexing import compile_conditions, conditions_of
from observer_rt.core.frames.frames import carries, decode_signals, encode_signals
from tests.bus.database import random_databases

FLOAT_FORMAT = {32: "f", 64: "d"}
many = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
all_messages = st.one_of(random_databases.plain_messages(), random_databases.multiplexed_messages())


@st.composite
def payloads(draw: st.DrawFn, random: random_databases.RandomMessage) -> bytes:
    """Random contents, the selectors at values the database knows, reserved codes more often than by chance."""
    payload = draw(st.binary(min_size=random.size, max_size=random.size))
    for field in random.fields:
        codes = [code for code in (field.not_available, field.error) if code is not None]
        if codes and draw(st.integers(0, 3)) == 0:
            payload = random_databases.with_bits(payload, field, draw(st.sampled_from(codes)))
    for field in random.fields:
        if random.selectors.get(field.name):
            payload = random_databases.with_bits(
                payload, field, draw(st.sampled_from(sorted(random.selectors[field.name])))
            )
    return payload


def selected(message: Message, payload: bytes) -> list[str]:
    frame = np.frombuffer(payload, np.uint8)
    names = []
    for signal in message.signals:
        selection = compile_conditions(message, conditions_of(message, signal.name))
        if carries(frame, selection, 0, len(selection.conditions)):
            names.append(signal.name)
    return names


def reserved(field: random_databases.Field) -> set[int]:
    return {code for code in (field.not_available, field.error) if code is not None}


def bits_of(field: random_databases.Field, raw: float) -> int:
    """The raw value as the unsigned number in the field."""
    if field.is_float:
        return int.from_bytes(struct.pack(">" + FLOAT_FORMAT[field.length], raw), "big")
    return int(raw) & (1 << field.length) - 1


@many
@given(all_messages.filter(lambda random: bool(random.fields)), st.data())
def test_decode(random: random_databases.RandomMessage, data: st.DataObject) -> None:
    message = random.load()
    payload = data.draw(payloads(random))
    expected = message.decode(payload, decode_choices=False)
    raw = message.decode(payload, decode_choices=False, scaling=False)
    assert sorted(selected(message, payload)) == sorted(expected)
    got = np.zeros(len(expected))
    decode_signals(np.frombuffer(payload, np.uint8), signal_table(message, list(expected)), got)
    for (name, value), ours in zip(expected.items(), got.tolist(), strict=True):
        field = next(f for f in random.fields if f.name == name)
        if bits_of(field, raw[name]) in reserved(field) or is_far_outside(field, raw[name]):
            assert math.isnan(ours), field
        else:
            largest_term = max(abs(raw[name] * field.scale), abs(field.offset))
            slack = 0.0 if exact_in_float64(field, raw[name]) else 3 * math.ulp(float(largest_term))
            assert random_databases.same_float(ours, float(value)) or abs(ours - value) <= slack, field


def is_far_outside(field: random_databases.Field, raw: float) -> bool:
    low, high = sorted(round((limit - field.offset) / field.scale) for limit in field.limits)
    return field.limits != (0, 0) and not 0 <= raw - low + 0.01 * (high - low) <= 1.02 * (high - low)


def exact_in_float64(field: random_databases.Field, raw: float) -> bool:
    """Whether the whole numbers that cantools multiplies exactly are float64 numbers, too."""
    is_whole = float(field.scale).is_integer() and not field.is_float  # 3.0 counts as 3 for cantools
    return not is_whole or abs(raw * field.scale) <= 1 << 53


@st.composite
def values(draw: st.DrawFn, field: random_databases.Field) -> float:
    """A physical value: near a code of the field, far outside, or infinite."""
    if field.is_float:
        raw = draw(st.floats(-1e6, 1e6, width=32))
    else:
        lowest = -(1 << field.length - 1) if field.is_signed else 0
        raw = draw(st.integers(lowest, lowest + (1 << field.length) - 1)) + draw(st.sampled_from([0.0, 0.5, -0.25]))
    return draw(st.sampled_from([1.0, 1.0, 1.0, 1e3, math.inf])) * float(raw * field.scale + field.offset)


@many
@given(all_messages, st.data())
def test_encode(random: random_databases.RandomMessage, data: st.DataObject) -> None:
    assume(random.fields)
    message = random.load()
    by_name = {field.name: field for field in random.fields}
    payload = data.draw(payloads(random))
    active = selected(message, payload)
    ours: dict[str, float] = {}
    codes: dict[str, float] = {}
    for name in active:
        field = by_name[name]
        if name in random.selectors:
            ours[name] = codes[name] = message.decode(payload, decode_choices=False)[name]
            continue
        value = data.draw(values(field))
        assume(not math.isnan(value))
        ours[name] = value
        codes[name] = _reference_code(field, message.get_signal_by_name(name), value)
    expected = message.encode(codes, scaling=False, strict=False)
    frame = np.zeros(message.length, np.uint8)
    encode_signals(np.array(list(ours.values()), float), signal_table(message, list(ours)), frame)
    if frame.tobytes() == expected:
        return
    # A reserved code is stepped over to a neighbour: to which one, either way round, is ours to choose.
    back = message.decode(frame.tobytes(), scaling=False, decode_choices=False)
    for name, code in codes.items():
        field = by_name[name]
        if bits_of(field, code) in reserved(field):
            assert bits_of(field, back[name]) not in reserved(field)
            assert abs(back[name] - code) <= 2
        else:
            assert bits_of(field, back[name]) == bits_of(field, code), field


def _reference_code(field: random_databases.Field, signal: Signal, value: float) -> float:
    """Raw value by cantools of a value that is clamped to limits and field first."""
    low, high = (-math.inf, math.inf) if field.limits == (0, 0) else field.limits
    value = min(max(value, low), high)
    if field.is_float:
        largest = 3.4028234663852886e38 if field.length == 32 else 1.7976931348623157e308
        return max(-largest, min(largest, (value - field.offset) / field.scale))
    lowest = -(1 << field.length - 1) if field.is_signed else 0
    highest = lowest + (1 << field.length) - 1
    if field.length > 53:
        highest = int(math.nextafter(float(highest + 1), 0.0))  # the largest that a float64 holds
    if math.isinf(value):
        return highest if (value > 0) == (field.scale > 0) else lowest
    return max(lowest, min(highest, float(signal.conversion.numeric_scaled_to_raw(value))))


@given(random_databases.multiplexed_messages())
def test_a_frame_with_an_unknown_selector_carries_nothing_multiplexed(random: random_databases.RandomMessage) -> None:
    outer = next(one for one in random.fields if one.name == "Outer")
    unknown = next(code for code in range(256) if code not in random.selectors["Outer"])
    payload = random_databases.with_bits(bytes(random.size), outer, unknown)
    assert set(selected(random.load(), payload)) == {one.name for one in random.fields if one.mark in ("", "M")}


@many
@given(random_databases.plain_messages().filter(lambda random: bool(random.fields)), st.data())
def test_encoding_changes_no_bit_of_others(random: random_databases.RandomMessage, data: st.DataObject) -> None:
    before = data.draw(st.binary(min_size=random.size, max_size=random.size))
    chosen = data.draw(st.sampled_from(random.fields))
    after = np.frombuffer(before, np.uint8).copy()
    encode_signals(np.array([1.0]), signal_table(random.load(), [chosen.name]), after)
    own = np.frombuffer(random_databases.with_bits(bytes(random.size), chosen, (1 << chosen.length) - 1), np.uint8)
    assert not np.any((after ^ np.frombuffer(before, np.uint8)) & ~own)
