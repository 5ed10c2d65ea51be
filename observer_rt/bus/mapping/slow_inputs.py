"""Optional inputs: slow signals that need neither grid nor index; one value a frame, of which the newest counts."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from cantools.database.can import Message
from numba import njit
from numpy.typing import NDArray

from observer_rt.bus.database import e2e
from observer_rt.bus.database.codec import decode, encode, signal_table
from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.bus.database.multiplexing import Selection, compile_conditions, conditions_of, is_selected
from observer_rt.config.signals import OptionalRole
from observer_rt.foundation.units import MILLISECOND

CYCLES = 10  # of a message, after which its last value is too old
SHORTEST_TIMEOUT = 1.0  # s, unless the bench file asks for less


class Receipt(IntEnum):
    """What became of a frame with slow inputs."""

    GOOD = 0
    LENGTH_ERROR = 1
    CRC_ERROR = 2
    REPEATED = 3  # by the counter of its protection: nothing new


_GOOD, _LENGTH_ERROR, _CRC_ERROR, _REPEATED = (int(receipt) for receipt in Receipt)


@dataclass(frozen=True, eq=False)
class SlowSignal:
    """The signal of an optional role."""

    role: OptionalRole
    name: str
    table: NDArray[np.void]
    """One row, `codec.SIGNAL`."""
    selection: Selection
    """What a multiplexed frame must hold to carry it."""
    factor: float
    """To SI."""
    origin: float = 0.0
    """What its 0 is in SI."""
    timeout: float = math.inf
    """After which a value counts no longer [s]."""
    untold: float = math.nan
    """What frames made of a recording say [SI], nan: not available."""

    @property
    def has_not_available(self) -> bool:
        """Whether the signal has a code for that."""
        return bool(self.table[0]["has_not_available"])


@dataclass(frozen=True, eq=False)
class SlowMessage:
    """A message with optional inputs; `frame` is one row, `inputs.INPUT_MESSAGE`, its key, length and protection."""

    layout: MessageLayout
    frame: NDArray[np.void]
    signals: tuple[SlowSignal, ...]
    is_input: bool
    """Whether it carries samples too; what is wrong with its frames is then counted there."""


def slow_signal(message: Message, role: OptionalRole, name: str, factor: float, origin: float) -> SlowSignal:
    """Compile the signal `name` of a message. Raises `UserError` when it is missing or cannot be decoded."""
    selection = compile_conditions(message, conditions_of(message, name))
    return SlowSignal(role, name, signal_table(message, [name]), selection, factor, origin)


def slow_timeout(configured_ms: float | None, cycle_time_ns: int | None) -> float:
    """After which a value counts no longer [s]: as configured, else ten cycles of its message, else never."""
    if configured_ms is not None:
        return configured_ms * MILLISECOND
    return math.inf if cycle_time_ns is None else max(CYCLES * cycle_time_ns * 1e-9, SHORTEST_TIMEOUT)


def value_range(signal: SlowSignal) -> tuple[float, float]:
    """Lowest and highest value [SI] the signal can have."""
    row = signal.table[0]
    limits = [
        float(row[name] * row["scale"] + row["offset"]) * signal.factor + signal.origin
        for name in ("lowest", "highest")
    ]
    return min(limits), max(limits)


def say_nothing(message: SlowMessage, payload: NDArray[np.uint8]) -> None:
    """Make a frame without protection say by its slow signals what a recording knows of them: `SlowSignal.untold`."""
    for signal in message.signals:
        if is_selected(payload, signal.selection, 0, len(signal.selection.conditions)):
            encode(np.array([(signal.untold - signal.origin) / signal.factor]), signal.table, payload)


class SlowReceiver:
    """Checks and decodes the frames of messages with optional inputs."""

    def __init__(self, messages: Sequence[SlowMessage]) -> None:
        self._messages = {int(message.frame[0]["key"]): message for message in messages}
        self._counters = dict.fromkeys(self._messages, -1)
        self._value = np.zeros(1)
        self.crc_errors = 0
        self.length_errors = 0

    def is_ours(self, key: int) -> bool:
        """Whether the frames `key` (`frame_key.frame_key`) names may carry an optional input."""
        return key in self._messages

    def values(self, key: int, payload: NDArray[np.uint8]) -> Iterator[tuple[OptionalRole, float]]:
        """Optional inputs [SI] that a frame of ours carries, NaN: not available; none of a bad or repeated one."""
        message = self._messages[key]
        receipt, counter = check_frame(payload, message.frame, self._counters[key])
        self._counters[key] = counter
        if not message.is_input:
            self.length_errors += receipt == Receipt.LENGTH_ERROR
            self.crc_errors += receipt == Receipt.CRC_ERROR
        if receipt != Receipt.GOOD:
            return
        for signal in message.signals:
            if read_value(payload, signal.table, signal.selection, self._value):
                yield signal.role, float(self._value[0]) * signal.factor + signal.origin


@njit(cache=True, nogil=True)
def check_frame(payload, frame, last_counter):  # type: ignore[no-untyped-def]
    """`Receipt` of a frame, and the counter of its protection; last_counter: of the one before, -1: none yet.

    frame: (1,) `INPUT_MESSAGE`, of its message.
    """
    message = frame[0]
    if payload.size not in (message.length, message.padded_length):
        return _LENGTH_ERROR, last_counter
    if not e2e.check(payload, message.length, message.e2e_profile, message.data_id):
        return _CRC_ERROR, last_counter
    if message.e2e_profile == e2e.UNPROTECTED:
        return _GOOD, last_counter
    counter = int(e2e.frame_counter(payload, message.e2e_profile))
    return (_REPEATED if counter == last_counter else _GOOD), counter


@njit(cache=True, nogil=True)
def read_value(payload, table, selection, out):  # type: ignore[no-untyped-def]
    """Decode the signal in `table` (1,) into `out` (1,), in its database's unit; False: the frame is without it."""
    if not is_selected(payload, selection, 0, selection.conditions.size):
        return False
    decode(payload, table, out)
    return True
