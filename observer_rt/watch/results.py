"""What an observer publishes, read back from its frames, injection by injection."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.can_frame import frame_key
from observer_rt.bus.database import e2e
from observer_rt.bus.database.codec import decode
from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.bus.database.multiplexing import is_selected
from observer_rt.bus.links.link import BusFrame
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.bus.mapping.output_messages import (
    HEADER_SIGNALS,
    OutputMessage,
    RateMessage,
    StatusValues,
    SummaryValues,
)


@dataclass(frozen=True, eq=False)
class Rates:
    """Injection rates of consecutive samples [mm3/ms], (n,), nan: not available; index: of the first."""

    index: int
    rates: NDArray[np.float64]


Result: TypeAlias = Rates | SummaryValues | StatusValues
Payload: TypeAlias = NDArray[np.uint8]


def layout_key(layout: MessageLayout) -> int:
    """The `frame_key` of a message's frames."""
    return frame_key(layout.frame_id, layout.is_extended, layout.bus)


class ResultReader:
    """Reads the result frames of one injector. Frames that its protection refuses are counted and left out."""

    def __init__(self, bus: BusMap) -> None:
        self.refused = 0
        """Frames of wrong length or checksum."""
        self._messages: dict[int, tuple[MessageLayout, Callable[[Payload], Result | None]]] = {}
        if bus.rate is not None:
            self._messages[layout_key(bus.rate.layout)] = bus.rate.layout, _rates_of(bus.rate)
        for message, kind in ((bus.summary, SummaryValues), (bus.status, StatusValues)):
            self._messages[layout_key(message.layout)] = message.layout, _values_of(message, kind)

    def read(self, came: BusFrame) -> Result | None:
        """What a frame says; None where it is none of these, is refused, or more pages are to come.

        All numbers of summary and status are floats, nan where they are not available.
        """
        frame = came.frame
        found = self._messages.get(frame_key(frame.frame_id, frame.is_extended, came.bus))
        if found is None:
            return None
        layout, result_of = found
        payload = np.frombuffer(frame.payload, np.uint8)
        profile, data_id = layout.e2e_profile or e2e.UNPROTECTED, layout.e2e_data_id or 0
        if payload.size < layout.length or not e2e.check(payload, layout.length, profile, data_id):
            self.refused += 1
            return None
        return result_of(payload)


def _rates_of(message: RateMessage) -> Callable[[Payload], Rates | None]:
    page = message.page
    index_at = page.names.index(HEADER_SIGNALS[0]) if HEADER_SIGNALS[0] in page.names else None

    def read(payload: Payload) -> Rates | None:
        values = np.empty(page.table.size)
        decode(payload, page.table, values)
        if index_at is None or np.isnan(values[index_at]):
            return None
        return Rates(int(values[index_at]), values[-message.samples :])

    return read


def _values_of(
    message: OutputMessage, kind: type[SummaryValues] | type[StatusValues]
) -> Callable[[Payload], SummaryValues | StatusValues | None]:
    """Collects the values of a message that may take several frames: nan for those that are not in it."""
    collected = np.full(len(kind._fields), np.nan)
    missing = set(range(len(message.pages)))

    def read(payload: Payload) -> SummaryValues | StatusValues | None:
        for number, page in enumerate(message.pages):
            if is_selected(payload, page.selection, 0, page.selection.conditions.size):
                values = np.empty(page.table.size)
                decode(payload, page.table, values)
                collected[page.places] = values
                missing.discard(number)
        if missing:
            return None
        missing.update(range(len(message.pages)))
        return kind._make(collected.tolist())

    return read


Signal = NDArray[np.float32]


class SampleCurves(NamedTuple):
    """The samples of an injection, (n,): time since the first [ms]; nan where nothing came.

    rail_pressure, line_pressure [MPa]; needle_lift [um]; rate [mm3/ms] as published, nominal by the model as given;
    the three rows of phi [1/s], of the wear as published.
    """

    time: Signal
    rail_pressure: Signal
    needle_lift: Signal
    line_pressure: Signal
    rate: Signal
    nominal: Signal
    phi_1: Signal
    phi_2: Signal
    phi_3: Signal


@dataclass(frozen=True, eq=False)
class SeenInjection:
    """An injection: its summary as published, when that came [ns since 1970], its samples, None if not known.

    nominal_mass [mg]: by the model as given, nan where that is not known.
    """

    summary: SummaryValues
    moment: int
    curves: SampleCurves | None = None
    nominal_mass: float = np.nan
