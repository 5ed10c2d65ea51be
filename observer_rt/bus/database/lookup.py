"""Look-up in bus databases: messages, signals, their units, layout attributes, and end-to-end protection."""

import hashlib
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from cantools.database.can import Database, Message, Signal

from observer_rt.bus.can_frame import CLASSIC_LENGTH, frame_key
from observer_rt.core.frames.frames import PROFILE_1, PROFILE_5, PROTECTION, UNPROTECTED
from observer_rt.foundation.errors import UserError, nearest
from observer_rt.foundation.units import NANOSECONDS_PER_MS, factor_of

PROFILES = (PROFILE_1, PROFILE_5)

USUAL_INDEX = "SampleIndex"  # where the bench file names none
INDEX_BITS = 32
NOT_AVAILABLE_NAMES = ("sna", "not_available", "signal_not_available", "value_not_available")
ERROR_NAMES = ("error", "err", "signal_error")
_PLAIN = str.maketrans(" -", "__")  # of names in a value table
_DATA_ID = "E2EDataId"


def protection_of(profile: int | None, data_id: int | None) -> np.void:
    """Protection of a message, a row `PROTECTION`."""
    row = np.zeros(1, PROTECTION)
    row["profile"] = profile or UNPROTECTED
    row["data_id"] = data_id or 0
    protection: np.void = row[0]
    return protection


@dataclass(frozen=True)
class MessageLayout:
    """Layout of a message besides its signals; None where the database states nothing. length [bytes].

    `e2e_profile` is the AUTOSAR profile number, None without protection.
    """

    name: str
    frame_id: int
    is_extended: bool
    is_fd: bool
    length: int
    samples_per_frame: int | None
    sample_period_ns: int | None
    cycle_time_ns: int | None
    e2e_profile: int | None
    e2e_data_id: int | None
    bus: int = 0
    """Number of the bus it is on."""

    @cached_property
    def protection(self) -> np.void:
        """Protection as compiled code takes it, a row `PROTECTION`."""
        return protection_of(self.e2e_profile, self.e2e_data_id)

    @property
    def key(self) -> int:
        """The `frame_key` of its frames."""
        return frame_key(self.frame_id, self.is_extended, self.bus)

    @classmethod
    def of(cls, message: Message, bus: int = 0) -> "MessageLayout":
        """Reads the layout of `message`. Raises `UserError`: an attribute is no number, or no data id protects it."""
        e2e_profile = _integer_attribute(message, "E2EProfile") or None
        e2e_data_id = _integer_attribute(message, _DATA_ID)
        if e2e_profile in PROFILES and e2e_data_id is None:
            problem = f"is protected by E2E profile {e2e_profile}, but has no attribute {_DATA_ID}"
            remedy = f'add BA_ "{_DATA_ID}" to the message, or set its E2EProfile to 0'
            raise UserError(f"message {message.name}", problem, remedy)
        return cls(
            name=message.name,
            frame_id=message.frame_id,
            is_extended=message.is_extended_frame,
            is_fd=message.is_fd or message.length > CLASSIC_LENGTH,  # which nothing else carries
            length=message.length,
            samples_per_frame=_integer_attribute(message, "SamplesPerFrame") or None,
            sample_period_ns=_integer_attribute(message, "SamplePeriodNs") or None,
            cycle_time_ns=(message.cycle_time or 0) * NANOSECONDS_PER_MS or None,
            e2e_profile=e2e_profile,
            e2e_data_id=e2e_data_id if e2e_profile is not None else None,
            bus=bus,
        )


def database_hash(paths: Iterable[Path]) -> int:
    """First 32 bits of the SHA-256 over the bytes of all files, in this order. Raises `UserError`: unreadable."""
    digest = hashlib.sha256()
    for path in paths:
        try:
            digest.update(path.read_bytes())
        except OSError as error:
            raise UserError(str(path), f"cannot be read: {error.strerror}") from None
    return int.from_bytes(digest.digest()[:4], "big")


def find_message(database: Database, name: str) -> Message:
    """The message called `name`. Raises `UserError` naming the nearest name."""
    names = [message.name for message in database.messages]
    if name not in names:
        raise UserError(f"message {name}", "not in the bus database", _nearest(name, names))
    return database.get_message_by_name(name)


def signal_names(message: Message, pattern_or_list: str | Sequence[str]) -> tuple[str, ...]:
    """Names of the signals of a mapping, in sample order.

    A list names them singly, text with a replacement field (`"RailPressure_{:02d}"`) all it produces with 0 or 1, 2,
    ..., other text one. Raises `UserError`: a signal is not in the message, or the pattern leaves out a number.
    """
    names = [signal.name for signal in message.signals]
    location = f"message {message.name}"
    if not isinstance(pattern_or_list, str):
        wanted = tuple(pattern_or_list)
        if not wanted:
            raise UserError(location, "the list of signals is empty", "name at least one signal")
        if len(set(wanted)) != len(wanted):
            twice = next(name for name in wanted if wanted.count(name) > 1)
            raise UserError(location, f"signal {twice} is listed twice", "list every signal once")
    elif "{" in pattern_or_list:
        wanted = _expand(pattern_or_list, names, location)
    else:
        wanted = (pattern_or_list,)
    for name in wanted:
        find_signal(message, name)
    return wanted


def find_signal(message: Message, name: str) -> Signal:
    """The signal called `name`. Raises `UserError` naming the nearest name."""
    names = [signal.name for signal in message.signals]
    if name not in names:
        raise UserError(f"message {message.name}", f"has no signal {name}", _nearest(name, names))
    return message.get_signal_by_name(name)


def reserved_codes(signal: Signal) -> tuple[int | None, int | None]:
    """Raw codes of "not available" and "error", by `GenSigSNA`, `GenSigError` or the value table's names, or None.

    Raises `UserError`: an attribute is not a code of the signal's width.
    """
    return _raw_code(signal, "GenSigSNA", NOT_AVAILABLE_NAMES), _raw_code(signal, "GenSigError", ERROR_NAMES)


def _raw_code(signal: Signal, attribute: str, names: Collection[str]) -> int | None:
    """The code as the bits of the field; -1 of an unsigned signal means none, other negatives are codes."""
    code = stated = _integer_attribute(signal, attribute)
    if stated is None and not signal.conversion.is_float:
        plain = ((int(value), str(name).strip().lower()) for value, name in (signal.choices or {}).items())
        code = next((value for value, name in plain if name.translate(_PLAIN) in names), None)
    if code is None or (code == -1 and not signal.is_signed):
        return None
    bits: int = signal.length
    lowest = -(1 << (bits - 1)) if signal.is_signed else 0
    if not lowest <= code < (1 << bits):
        if stated is None:
            return None  # a label for what is never sent
        problem = f"{attribute} is {code}, which its {bits} bits cannot hold"
        raise UserError(f"signal {signal.name}", problem, f"give a raw code from 0 to {(1 << bits) - 1}")
    return code & ((1 << bits) - 1)


def _integer_attribute(owner: Message | Signal, name: str) -> int | None:
    """A database attribute at `owner` itself as an integer; text like "0xFFFF" is accepted."""
    attributes = owner.dbc.attributes if owner.dbc is not None else None
    if not attributes or name not in attributes:
        return None
    value = attributes[name].value
    try:
        number: int | None = int(value, 0) if isinstance(value, str) else int(value)
    except (ValueError, OverflowError):
        number = None
    if number is None or (isinstance(value, float) and number != value):
        raise UserError(f"{owner.name}, attribute {name}", f"{value!r} is not a whole number")
    return number


def _expand(pattern: str, names: Sequence[str], location: str) -> tuple[str, ...]:
    try:
        # One number more than there are signals, because counting may start at 1.
        produced = [pattern.format(number) for number in range(len(names) + 1)]
    except (ValueError, IndexError, KeyError):
        problem = f"{pattern!r} is not a pattern of signal names"
        raise UserError(location, problem, 'write it with one number field, as in "RailPressure_{:02d}"') from None
    present = [number for number, name in enumerate(produced) if name in names]
    if not present or present[0] > 1:
        raise UserError(location, f"has no signal {produced[0]} (from {pattern!r})", _nearest(produced[0], names))
    missing = sorted(set(range(present[0], present[-1])) - set(present))
    if missing:
        problem = f"{pattern!r} leaves out {produced[missing[0]]}, though {produced[present[-1]]} exists"
        raise UserError(location, problem, "list the signals one by one, in sample order")
    return tuple(produced[number] for number in present)


def _nearest(name: str, names: Sequence[str]) -> str:
    best = nearest(name, names)
    if best is not None:
        return f"nearest name: {best}"
    return f"there are: {', '.join(names)}" if names else "it has none at all: give another database"


def from_unit(location: str, message: Message, signal: str, unit: str | None, units: Mapping[str, float]) -> float:
    """Factor from a signal's unit to SI; unit: of the bench file, which goes before that of the database.

    Raises `UserError` naming `location` of the bench file for a unit that is neither in `units` nor a number of one.
    """
    stated = stated_unit(message, signal, unit)
    factor = factor_of(stated, units)
    if factor is None:
        name = next(iter(units))
        raise unknown_unit(location, message, stated, unit, units, f', or a number of them ("98066.5 {name}")')
    return factor


def stated_unit(message: Message, signal: str, unit: str | None) -> str:
    """The unit of a signal: `unit` of the bench file, or else what the database states; empty without."""
    return unit or find_signal(message, signal).unit or ""


def unknown_unit(
    location: str, message: Message, stated: str, own: str | None, units: Iterable[str], others: str = ""
) -> UserError:
    """The error for a unit that is not one of `units`; own: that of the bench file, if any; others: more choices."""
    choices = f"one of {', '.join(units)}{others}"
    if own:
        return UserError(f"{location}.unit", f"{own!r} is no unit of this quantity", f"write {choices}")
    problem = f"unit {stated!r} of {message.name} is not known" if stated else f"{message.name} states no unit"
    return UserError(location, problem, f'add unit = "..." with {choices}')
