"""Messages that carry the results: their layouts, and their frames as tables for compiled code."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from cantools.database.can import Message
from numpy.typing import NDArray

from observer_rt.bus.can_frame import FD_LENGTHS
from observer_rt.bus.database import multiplexing
from observer_rt.bus.database.codec import signal_table
from observer_rt.bus.database.lookup import PROFILES, MessageLayout, signal_names
from observer_rt.bus.mapping.output_signals import signals_of
from observer_rt.core.frames.frames import Header, shortest_protected
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import Ints, Structs

HEADER_SIGNALS = signals_of(Header)
RATE_PATTERN = "InjectionRate_{:02d}"


class OutputPage(NamedTuple):
    """Frame of an output message: the known signals, their table and places among all; blank: without values.

    selection: selector values by which a received frame is this one.
    """

    names: tuple[str, ...]
    table: Structs
    blank: NDArray[np.uint8]
    places: Ints
    selection: multiplexing.Selection


class OutputMessage(NamedTuple):
    """A message of results. A multiplexed message takes several frames, its pages, each time it is sent."""

    layout: MessageLayout
    pages: tuple[OutputPage, ...]


class RateMessage(NamedTuple):
    """The message that carries the injection rate; the last `samples` signals of its page are the rates."""

    layout: MessageLayout
    page: OutputPage
    samples: int


def output_message(message: Message, signals: Sequence[str], bus: int = 0) -> OutputMessage:
    """Message for a bus with as many of `signals` as it has. Raises `UserError`: bad protection or signal."""
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
    """Message for a bus with its rates and any `HEADER_SIGNALS`. Raises `UserError`: no rates, or multiplexed."""
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
