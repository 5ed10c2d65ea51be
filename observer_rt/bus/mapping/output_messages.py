"""The messages the results go out in: which signals they are made of, in which frames."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from cantools.database.can import Message
from numpy.typing import NDArray

from observer_rt.bus.database.codec import signal_table
from observer_rt.bus.database.e2e import PROFILES, shortest_frame
from observer_rt.bus.database.lookup import MessageLayout, signal_names
from observer_rt.bus.database.multiplexing import Conditions, blank_frame, conditions_of, frame_kinds, meets
from observer_rt.foundation.errors import UserError

HEADER_SIGNALS = ("SampleIndex", "Valid", "Learning", "State")
RATE_PATTERN = "InjectionRate_{:02d}"
SUMMARY_SIGNALS = (
    *HEADER_SIGNALS,
    "EndIndex",
    "InjectionNumber",
    "EventNumber",
    "PhiVersion",
    "InjectorId",
    "Reason",
    "Mass",
    "MassSigma",
    "Volume",
    "RailPressureAtStart",
    "PeakInjectionRate",
    "NozzleWear",
    "NozzleWearSigma",
    "SeatWear",
    "SeatWearSigma",
    "LinePressureOffset",
)
STATUS_SIGNALS = (
    *HEADER_SIGNALS,
    "Reason",
    "InjectorId",
    "VersionMajor",
    "VersionMinor",
    "VersionPatch",
    "ModelHash",
    "DatabaseHash",
    "SamplesProcessed",
    "LostSamples",
    "InterpolatedSamples",
    "CrcErrors",
    "SequenceErrors",
    "LengthErrors",
    "RepeatedFrames",
    "OldFrames",
    "DroppedFrames",
    "LinkTroubles",
    "TroubledBus",
    "Restarts",
    "Adoptions",
    "RejectedAdoptions",
    "LateAdoptions",
)
# Our layouts have no room for these; a status message of a user's own may have them.
ENERGIZING_STATUS_SIGNALS = ("MissingInjections", "UncommandedInjections")


@dataclass(frozen=True)
class OutputPage:
    """One frame of an output message: `names` of the known signals in it, their table, and the frame without them."""

    names: tuple[str, ...]
    table: NDArray[np.void]
    blank: NDArray[np.uint8]


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
    return OutputMessage(
        protected_layout(message, bus),
        tuple(_page(message, conditions, kind) for kind in frame_kinds(conditions.values())),
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


def _page(message: Message, conditions: Mapping[str, Conditions], kind: Mapping[str, int]) -> OutputPage:
    names = tuple(name for name, needed in conditions.items() if meets(kind, needed))
    return OutputPage(names, signal_table(message, names), blank_frame(message, kind))


def protected_layout(message: Message, bus: int) -> MessageLayout:
    """Layout of a message, on the bus of this number; raises `UserError` unless its protection is supported."""
    layout = MessageLayout.of(message, bus)
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
