"""Messages the results go out in: their signals, their frames, and how long a frame occupies the bus."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from cantools.database.can import Message
from numpy.typing import NDArray

from observer_rt.bus.can_frame import CLASSIC_LENGTH, FD_LENGTHS, length_code, length_of
from observer_rt.bus.database import multiplexing
from observer_rt.bus.database.codec import signal_table
from observer_rt.bus.database.lookup import PROFILES, MessageLayout, signal_names
from observer_rt.bus.mapping.output_signals import signals_of
from observer_rt.core.frames.frames import Header, shortest_protected
from observer_rt.foundation.errors import UserError

HEADER_SIGNALS = signals_of(Header)
RATE_PATTERN = "InjectionRate_{:02d}"

# A stuff bit follows five equal bits. From the first bit of a run (the stuff bit itself begins one) it takes
# on average 2^5 - 2 random bits to see four more of the same.
BITS_PER_STUFF_BIT = 30.0

# Lengths in bits, ISO 11898-1.
_CLASSIC_HEAD = 19  # start 1, identifier 11, RTR 1, IDE 1, r0 1, DLC 4
_CLASSIC_HEAD_EXTENDED = 39  # start 1, identifier 11 + 18, SRR 1, IDE 1, RTR 1, r1 r0 2, DLC 4
_CLASSIC_CRC = 15
_CLASSIC_TAIL = 13  # CRC delimiter 1, ACK 1, ACK delimiter 1, end of frame 7, intermission 3
_FD_HEAD = 17  # start 1, identifier 11, RRS 1, IDE 1, FDF 1, res 1, BRS 1
_FD_HEAD_EXTENDED = 36  # start 1, identifier 11 + 18, SRR 1, IDE 1, RRS 1, FDF 1, res 1, BRS 1
_FD_CONTROL = 5  # ESI 1, DLC 4
_FD_STUFF_COUNT = 4  # Gray code 3, parity 1
_FD_SHORT_CRC = 17  # up to 16 bytes
_FD_LONG_CRC = 21
_FD_CRC_DELIMITER = 1
_FD_TAIL = 12  # ACK 1, ACK delimiter 1, end of frame 7, intermission 3


class OutputPage(NamedTuple):
    """Frame of an output message: `names` of the known signals in it, their table, and the frame without them.

    places: of these signals among all known ones. selection: what a received frame must hold to be this one.
    """

    names: tuple[str, ...]
    table: NDArray[np.void]
    blank: NDArray[np.uint8]
    places: NDArray[np.int64]
    selection: multiplexing.Selection


class OutputMessage(NamedTuple):
    """Message of results. A multiplexed message takes several frames, its pages, each time it is sent."""

    layout: MessageLayout
    pages: tuple[OutputPage, ...]


class RateMessage(NamedTuple):
    """The message the injection rate goes out in; the last `samples` signals of its page are the rates."""

    layout: MessageLayout
    page: OutputPage
    samples: int


def output_message(message: Message, signals: Sequence[str], bus: int = 0) -> OutputMessage:
    """A message for the bus of this number, with as many of `signals` as it has.

    Raises `UserError`: its protection is not supported, or a signal cannot be encoded.
    """
    present = {signal.name for signal in message.signals}
    conditions = {name: multiplexing.conditions_of(message, name) for name in signals if name in present}
    kinds = multiplexing.frame_kinds(conditions.values())
    pages = []
    for kind in kinds:
        names = tuple(name for name, needed in conditions.items() if multiplexing.meets(kind, needed))
        held = frozenset(multiplexing.Condition(selector, frozenset({value})) for selector, value in kind.items())
        places = np.array([signals.index(name) for name in names], np.int64)
        selection = multiplexing.compile_conditions(message, held)
        blank = multiplexing.blank_frame(message, kind)
        pages.append(OutputPage(names, signal_table(message, names), blank, places, selection))
    return OutputMessage(protected_layout(message, bus), tuple(pages))


def rate_message(message: Message, bus: int = 0) -> RateMessage:
    """A message for the bus of this number, with its rates and as many of `HEADER_SIGNALS` as it has.

    Raises `UserError`: it has no rates, is multiplexed, or cannot be encoded.
    """
    rates = signal_names(message, RATE_PATTERN)
    output = output_message(message, (*HEADER_SIGNALS, *rates), bus)
    if len(output.pages) > 1:
        problem = "is multiplexed, which a message of injection rates may not be"
        raise UserError(f"message {message.name}", problem, "name one in [outputs] that is not, or set false")
    return RateMessage(output.layout, output.pages[0], len(rates))


def protected_layout(message: Message, bus: int) -> MessageLayout:
    """Layout of a message, on the bus of this number; raises `UserError` unless its protection is supported."""
    layout = MessageLayout.of(message, bus)
    if layout.length > FD_LENGTHS[-1]:
        problem = f"has {layout.length} bytes, no frame more than {FD_LENGTHS[-1]}"
        remedy = "correct its length in the bus database; messages of several frames are not put together"
        raise UserError(f"message {layout.name}", problem, remedy)
    if layout.e2e_profile not in (None, *PROFILES):
        raise UserError(
            f"message {layout.name}",
            f"is protected by E2E profile {layout.e2e_profile}",
            f"only the profiles {', '.join(map(str, PROFILES))} are supported; 0 takes its frames without a check",
        )
    if layout.e2e_profile is not None and layout.length < shortest_protected(layout.e2e_profile):
        problem = f"has {layout.length} bytes, which E2E profile {layout.e2e_profile} does not fit in"
        raise UserError(f"message {layout.name}", problem, "correct its length or its E2EProfile")
    return layout


def frame_time(length: int, is_fd: bool, bit_rate: float, data_bit_rate: float, is_extended: bool) -> float:
    """Time [s] one frame of `length` data bytes occupies the bus, intermission included.

    `bit_rate` and `data_bit_rate` in bit/s; the latter counts for CAN FD only, whose frames are sent with the
    bit rate switched. A length CAN FD does not have takes the next one that it has.

    Raises `ValueError`: no frame of this kind holds `length` bytes.
    """
    if not 0 <= length <= (FD_LENGTHS[-1] if is_fd else CLASSIC_LENGTH):
        raise ValueError(f"no {'CAN FD' if is_fd else 'classic CAN'} frame holds {length} bytes")
    if not is_fd:
        stuffed = (_CLASSIC_HEAD_EXTENDED if is_extended else _CLASSIC_HEAD) + 8 * length + _CLASSIC_CRC
        return (_with_stuffing(stuffed) + _CLASSIC_TAIL) / bit_rate
    padded_length = length_of(length_code(length))
    head = _FD_HEAD_EXTENDED if is_extended else _FD_HEAD
    checksum = _FD_STUFF_COUNT + (_FD_SHORT_CRC if padded_length <= 16 else _FD_LONG_CRC)
    fixed_stuff_bits = -(-checksum // 4)  # one before the stuff count and one after every four bits
    fast = _with_stuffing(_FD_CONTROL + 8 * padded_length) + checksum + fixed_stuff_bits + _FD_CRC_DELIMITER
    return (_with_stuffing(head) + _FD_TAIL) / bit_rate + fast / data_bit_rate


def _with_stuffing(bits: int) -> float:
    return bits * (1.0 + 1.0 / BITS_PER_STUFF_BIT)
