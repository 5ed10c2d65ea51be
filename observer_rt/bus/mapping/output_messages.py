"""The messages the results go out in: which signals they are made of, in which frames."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from cantools.database.can import Message
from numpy.typing import NDArray

from observer_rt.bus.can_frame import FD_LENGTHS
from observer_rt.bus.database.codec import signal_table
from observer_rt.bus.database.e2e import PROFILES, shortest_frame
from observer_rt.bus.database.lookup import MessageLayout, signal_names
from observer_rt.bus.database.multiplexing import (
    Condition,
    Conditions,
    Selection,
    blank_frame,
    compile_conditions,
    conditions_of,
    frame_kinds,
    meets,
)
from observer_rt.foundation.errors import UserError

HEADER_SIGNALS = ("SampleIndex", "Valid", "Learning", "State")
RATE_PATTERN = "InjectionRate_{:02d}"


class SummaryValues(NamedTuple):
    """The signals of a summary, in the database's units: `mass_sigma` goes out as `MassSigma`."""

    sample_index: int
    valid: bool
    learning: bool
    state: int
    end_index: int
    injection_number: int
    event_number: int
    phi_version: int
    injector_id: int
    reason: int
    mass: float
    mass_sigma: float
    volume: float
    rail_pressure_at_start: float
    peak_injection_rate: float
    nozzle_wear: float
    nozzle_wear_sigma: float
    seat_wear: float
    seat_wear_sigma: float
    line_pressure_offset: float


class StatusValues(NamedTuple):
    """The signals of a status, as in `SummaryValues`."""

    sample_index: int
    valid: bool
    learning: bool
    state: int
    reason: int
    injector_id: int
    version_major: int
    version_minor: int
    version_patch: int
    model_hash: int
    database_hash: int
    samples_processed: int
    lost_samples: int
    interpolated_samples: int
    crc_errors: int
    sequence_errors: int
    length_errors: int
    repeated_frames: int
    old_frames: int
    dropped_frames: int
    link_troubles: int
    troubled_bus: int
    restarts: int
    adoptions: int
    rejected_adoptions: int
    late_adoptions: int
    foreign_frames: int
    rail_pressure_age: float  # s, nan: none came yet
    needle_lift_age: float
    line_pressure_age: float
    failed_writes: int
    # our layouts have no room for these; a status message of a user's own may have them
    missing_injections: int
    uncommanded_injections: int
    spikes: int
    bridged_samples: int


def signals_of(values: type[SummaryValues] | type[StatusValues]) -> tuple[str, ...]:
    """Names of the signals in a database, in order."""
    return tuple("".join(word.capitalize() for word in field.split("_")) for field in values._fields)


@dataclass(frozen=True)
class OutputPage:
    """One frame of an output message: `names` of the known signals in it, their table, and the frame without them.

    places: of these signals among all known ones. selection: what a received frame must hold to be this one.
    """

    names: tuple[str, ...]
    table: NDArray[np.void]
    blank: NDArray[np.uint8]
    places: NDArray[np.int64]
    selection: Selection


@dataclass(frozen=True)
class OutputMessage:
    """A message the results go out in. A multiplexed one takes several frames, the pages, each time it is sent."""

    layout: MessageLayout
    pages: tuple[OutputPage, ...]


@dataclass(frozen=True)
class RateMessage:
    """The message the injection rate goes out in; the last `samples` signals of its page are the rates."""

    layout: MessageLayout
    page: OutputPage
    samples: int


def output_message(message: Message, known: Sequence[str], bus: int = 0) -> OutputMessage:
    """The message, sent on the bus of this number, with those of the `known` signals that it has.

    Raises:
        UserError: its protection is not supported, or a signal cannot be encoded.
    """
    present = {signal.name for signal in message.signals}
    conditions = {name: conditions_of(message, name) for name in known if name in present}
    kinds = frame_kinds(conditions.values())
    return OutputMessage(
        protected_layout(message, bus), tuple(_page(message, known, conditions, kind) for kind in kinds)
    )


def rate_message(message: Message, bus: int = 0) -> RateMessage:
    """The message, sent on the bus of this number, with its rates and those of `HEADER_SIGNALS` that it has.

    Raises:
        UserError: it has no rates, is multiplexed, or cannot be encoded.
    """
    rates = signal_names(message, RATE_PATTERN)
    output = output_message(message, (*HEADER_SIGNALS, *rates), bus)
    if len(output.pages) > 1:
        raise UserError(
            f"message {message.name}",
            "is multiplexed, which a message of injection rates may not be",
            "set outputs.injection_rate to a message that is not, or to false",
        )
    return RateMessage(output.layout, output.pages[0], len(rates))


def _page(
    message: Message, known: Sequence[str], conditions: Mapping[str, Conditions], kind: Mapping[str, int]
) -> OutputPage:
    names = tuple(name for name, needed in conditions.items() if meets(kind, needed))
    places = np.array([known.index(name) for name in names], np.int64)
    held = frozenset(Condition(selector, frozenset({value})) for selector, value in kind.items())
    return OutputPage(
        names,
        signal_table(message, names),
        blank_frame(message, kind),
        places,
        compile_conditions(message, held),
    )


def protected_layout(message: Message, bus: int) -> MessageLayout:
    """Layout of a message, on the bus of this number; raises `UserError` unless its protection is supported."""
    layout = MessageLayout.of(message, bus)
    if layout.length > FD_LENGTHS[-1]:
        raise UserError(
            f"message {layout.name}",
            f"has {layout.length} bytes, no frame more than {FD_LENGTHS[-1]}",
            "correct its length in the bus database; messages of several frames are not put together",
        )
    if layout.e2e_profile not in (None, *PROFILES):
        raise UserError(
            f"message {layout.name}",
            f"is protected by E2E profile {layout.e2e_profile}",
            f"only the profiles {' and '.join(map(str, PROFILES))} are supported",
        )
    if layout.e2e_profile is not None and layout.length < shortest_frame(layout.e2e_profile):
        raise UserError(
            f"message {layout.name}",
            f"has {layout.length} bytes, which E2E profile {layout.e2e_profile} does not fit in",
            "correct its length or its E2EProfile",
        )
    return layout
