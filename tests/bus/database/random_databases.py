"""Random bus databases as DBC text, as hypothesis draws them: everything a signal can be, multiplexed or not."""

import math
import struct
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

from cantools.database.can import Message
from hypothesis import strategies as st

from observer_rt.bus.database.catalogue import load_database

FRAME_ID = 0x123
SIZES = [8, 8, 8, 8, 12, 12, 24, 64]  # bytes, the quick ones more often
EXTENDED_ID = 0x18FF1234
HEAD = """VERSION ""
BU_: Device
BO_ {frame_id} Random: {size} Device
"""
TAIL = """BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","a","b","c","d","e","f","g","h","i","j","k",\
"l","StandardCAN_FD","ExtendedCAN_FD";
BA_DEF_ SG_ "GenSigSNA" STRING ;
BA_DEF_ SG_ "GenSigError" STRING ;
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_DEF_DEF_ "GenSigSNA" "";
BA_DEF_DEF_ "GenSigError" "";
"""


@dataclass(frozen=True)
class Field:
    """A signal: `mark` is its multiplexing in the DBC (`M`, `m3`, `m3M` or nothing)."""

    name: str
    start: int
    length: int
    is_big_endian: bool
    mark: str = ""
    is_signed: bool = False
    is_float: bool = False
    scale: float = 1
    offset: float = 0
    limits: tuple[float, float] = (0, 0)
    not_available: int | None = None
    error: int | None = None

    def line(self) -> str:
        order = "01"[not self.is_big_endian]
        sign = "-" if self.is_signed or self.is_float else "+"
        low, high = self.limits
        return (
            f" SG_ {self.name} {self.mark} : {self.start}|{self.length}@{order}{sign} "
            f'({self.scale!r},{self.offset!r}) [{low!r}|{high!r}] "" Device'
        )


@dataclass
class RandomMessage:
    """A message's fields and extended multiplexing (signal, selector, ranges); selectors: their selecting values."""

    size: int
    fields: list[Field] = field(default_factory=list)
    selections: list[tuple[str, str, list[tuple[int, int]]]] = field(default_factory=list)
    is_extended: bool = False
    selectors: dict[str, set[int]] = field(default_factory=dict)

    def text(self) -> str:
        number = EXTENDED_ID | 1 << 31 if self.is_extended else FRAME_ID
        lines = [f.line() for f in self.fields]
        text = HEAD.format(frame_id=number, size=self.size) + "\n".join(lines) + "\n" + TAIL
        text += f'BA_ "VFrameFormat" BO_ {number} {14 + self.is_extended};\n' if self.size > 8 else ""
        for f in self.fields:
            if f.is_float:
                text += f"SIG_VALTYPE_ {number} {f.name} : {f.length // 32};\n"
            for attribute, code in (("GenSigSNA", f.not_available), ("GenSigError", f.error)):
                if code is not None:
                    text += f'BA_ "{attribute}" SG_ {number} {f.name} "{code:#x}";\n'
        for name, selector, ranges in self.selections:
            listed = ", ".join(f"{low}-{high}" for low, high in ranges)
            text += f"SG_MUL_VAL_ {number} {name} {selector} {listed};\n"
        return text

    def load(self) -> Message:
        with TemporaryDirectory() as folder:
            path = Path(folder, "random.dbc")
            path.write_text(self.text())
            return load_database(path).get_message_by_name("Random")


def numbers(magnitude: float) -> st.SearchStrategy[float]:
    return st.one_of(
        st.integers(-int(magnitude), int(magnitude)),
        st.floats(-magnitude, magnitude, allow_nan=False, allow_subnormal=False),
    )


def same_float(a: float, b: float) -> bool:
    """Equal to the bit, any NaN being like any other."""
    return (math.isnan(a) and math.isnan(b)) or struct.pack("d", a) == struct.pack("d", b)


def dbc_start(first: int, length: int, is_big_endian: bool) -> int:
    """Start in DBC counting of a field over transmitted bits [first, first + length), for big-endian."""
    return 8 * (first // 8) + 7 - first % 8 if is_big_endian else first


@st.composite
def signals(draw: st.DrawFn, name: str, first: int, length: int, is_big_endian: bool, mark: str) -> Field:
    is_float = length in (32, 64) and draw(st.booleans())
    is_signed = draw(st.booleans())
    limits = draw(st.sampled_from([(0, 0), (0.0, 0.0)]))
    scale = draw(st.one_of(st.just(1), numbers(1e3).filter(lambda x: abs(x) > 1e-6)))
    offset = draw(st.one_of(st.just(0), numbers(1e6)))
    codes: dict[str, int] = {}
    if not is_float and 4 <= length <= 32:
        lowest = -(1 << length - 1) if is_signed else 0
        highest = lowest + (1 << length) - 1
        if draw(st.booleans()):
            raw = sorted(draw(st.tuples(*[st.integers(lowest, highest)] * 2)))
            if raw[1] - raw[0] > 4:
                low, high = sorted(float(code * scale + offset) for code in raw)
                limits = (low, high)
        if draw(st.booleans()):
            codes["not_available"] = draw(st.sampled_from([(1 << length) - 1, 0, 1 << length - 1]))
        if draw(st.booleans()):
            codes["error"] = (codes.get("not_available", 1 << length) - 1) & ((1 << length) - 1)
    start = dbc_start(first, length, is_big_endian)
    return Field(name, start, length, is_big_endian, mark, is_signed, is_float, scale, offset, limits, **codes)


@st.composite
def areas(draw: st.DrawFn, message: RandomMessage, first: int, end: int, marks: tuple[str, ...]) -> None:
    """Fill transmitted bits [first, end) of a message with signals of one multiplexing mark each."""
    bit, is_big_endian = first, draw(st.booleans())
    while True:
        bit += draw(st.sampled_from([0, 0, 0, 1, 3, 11]))
        if draw(st.booleans()):
            is_big_endian = not is_big_endian
            bit = 8 * math.ceil(bit / 8)  # bits of two byte orders are counted in opposite directions
        length = draw(st.one_of(st.sampled_from([16, 32, 64]), st.integers(1, 64)))
        if bit + length > end:
            return
        name = f"S{len(message.fields)}"
        message.fields.append(draw(signals(name, bit, length, is_big_endian, draw(st.sampled_from(marks)))))
        bit += length


@st.composite
def plain_messages(draw: st.DrawFn) -> RandomMessage:
    message = RandomMessage(draw(st.sampled_from(SIZES)), is_extended=draw(st.booleans()))
    draw(areas(message, 0, 8 * message.size, ("",)))
    return message


def _selector(message: RandomMessage, name: str, byte: int, is_big_endian: bool, mark: str) -> None:
    message.fields.append(Field(name, dbc_start(8 * byte, 8, is_big_endian), 8, is_big_endian, mark))


@st.composite
def multiplexed_messages(draw: st.DrawFn) -> RandomMessage:
    """One selector; under some of its values a second one (extended), or several values for one group."""
    message = RandomMessage(draw(st.sampled_from(SIZES)), is_extended=draw(st.booleans()))
    is_nested = draw(st.booleans())
    _selector(message, "Outer", 0, draw(st.booleans()), "M")
    draw(areas(message, 8, 24, ("",)))
    values = draw(st.lists(st.integers(0, 255), min_size=1, max_size=4, unique=True))
    message.selectors["Outer"] = set()
    for n, value in enumerate(values):
        before = len(message.fields)
        if is_nested and n == 0:
            inner = draw(st.lists(st.integers(0, 255), min_size=1, max_size=3, unique=True))
            message.selectors["Inner"] = set()
            _selector(message, "Inner", 3, draw(st.booleans()), f"m{value}M")
            message.selections.append(("Inner", "Outer", [(value, value)]))
            for code in inner:
                first = len(message.fields)
                draw(areas(message, 32, 8 * message.size, (f"m{code}",)))
                message.selections += [(f.name, "Inner", [(code, code)]) for f in message.fields[first:]]
                message.selectors["Inner"] |= {code} if len(message.fields) > first else set()
        else:
            draw(areas(message, 24, 8 * message.size, (f"m{value}",)))
            if is_nested:
                message.selections += [(f.name, "Outer", [(value, value)]) for f in message.fields[before:]]
        message.selectors["Outer"] |= {value} if len(message.fields) > before else set()
    return message


def with_bits(payload: bytes, signal_field: Field, code: int) -> bytes:
    result = bytearray(payload)
    bit = signal_field.start
    order = range(signal_field.length)
    for k in reversed(order) if signal_field.is_big_endian else order:
        byte, mask = bit // 8, 1 << bit % 8
        result[byte] = result[byte] & ~mask | (mask if code >> k & 1 else 0)
        if not signal_field.is_big_endian:
            bit += 1
        else:
            bit = bit - 1 if bit % 8 else bit + 15
    return bytes(result)
