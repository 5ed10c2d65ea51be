"""What an observer publishes, read back from its frames, injection by injection."""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.database import e2e
from observer_rt.bus.database.codec import decode
from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.bus.database.multiplexing import is_selected
from observer_rt.bus.links.link import BusFrame
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.bus.mapping.output_messages import (
    HEADER_SIGNALS,
    OutputMessage,
    OutputPage,
    StatusValues,
    SummaryValues,
)


@dataclass(frozen=True, eq=False)
class Rates:
    """Injection rates of consecutive samples [mm3/ms], (n,), nan: not available; index: of the first."""

    index: int
    valid: bool
    rates: NDArray[np.float64]


Result: TypeAlias = Rates | SummaryValues | StatusValues


class ResultReader:
    """Reads the result frames of one injector. Frames that its protection refuses are counted and left out."""

    def __init__(self, bus: BusMap) -> None:
        self.refused = 0
        """Frames of wrong length or checksum."""
        self._rate = bus.rate
        names = () if bus.rate is None else bus.rate.page.names
        index, valid = HEADER_SIGNALS[:2]
        self._index_at = names.index(index) if index in names else None
        self._valid_at = names.index(valid) if valid in names else None
        self._summary = _Collected(bus.summary, len(SummaryValues._fields))
        self._status = _Collected(bus.status, len(StatusValues._fields))

    def read(self, came: BusFrame) -> Result | None:
        """What a frame says; None where it is none of these, is refused, or more pages are to come.

        All numbers of summary and status are floats, nan where they are not available.
        """
        if self._rate is not None and _is_of(self._rate.layout, came):
            payload = self._accepted(self._rate.layout, came)
            return None if payload is None else self._rates(self._rate.page, payload)
        for collected, kind in ((self._summary, SummaryValues), (self._status, StatusValues)):
            if _is_of(collected.message.layout, came):
                payload = self._accepted(collected.message.layout, came)
                values = None if payload is None else collected.after(payload)
                return None if values is None else kind._make(values)
        return None

    def _accepted(self, layout: MessageLayout, came: BusFrame) -> NDArray[np.uint8] | None:
        payload = np.frombuffer(came.frame.payload, np.uint8)
        profile, data_id = layout.e2e_profile or e2e.UNPROTECTED, layout.e2e_data_id or 0
        if payload.size >= layout.length and e2e.check(payload, layout.length, profile, data_id):
            return payload
        self.refused += 1
        return None

    def _rates(self, page: OutputPage, payload: NDArray[np.uint8]) -> Rates | None:
        values = np.empty(page.table.size)
        decode(payload, page.table, values)
        if self._rate is None or self._index_at is None or np.isnan(values[self._index_at]):
            return None
        valid = self._valid_at is not None and values[self._valid_at] == 1.0
        return Rates(int(values[self._index_at]), bool(valid), values[-self._rate.samples :])


class _Collected:
    """The values of a message that may take several frames."""

    def __init__(self, message: OutputMessage, width: int) -> None:
        self.message = message
        self._values = np.full(width, np.nan)
        self._missing = set(range(len(message.pages)))

    def after(self, payload: NDArray[np.uint8]) -> list[float] | None:
        """All values once their last page has come: nan where they are not available or not in the message."""
        for number, page in enumerate(self.message.pages):
            if is_selected(payload, page.selection, 0, page.selection.conditions.size):
                values = np.empty(page.table.size)
                decode(payload, page.table, values)
                self._values[page.places] = values
                self._missing.discard(number)
        if self._missing:
            return None
        self._missing = set(range(len(self.message.pages)))
        return self._values.tolist()


def _is_of(layout: MessageLayout, came: BusFrame) -> bool:
    frame = came.frame
    return (layout.bus, layout.frame_id, layout.is_extended) == (came.bus, frame.frame_id, frame.is_extended)


Signal = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class SampleCurves:
    """Its samples, (n,): time since the first [ms]; nan where nothing came.

    rail_pressure, line_pressure [MPa]; needle_lift [um]; rate [mm3/ms] as published, nominal by the model as given;
    phi (3, n) [1/s], of the wear as published.
    """

    time: Signal
    rail_pressure: Signal
    needle_lift: Signal
    line_pressure: Signal
    rate: Signal
    nominal: Signal
    phi: Signal


@dataclass(frozen=True, eq=False)
class SeenInjection:
    """An injection: its summary as published, when that came [ns since 1970], and its samples.

    nominal_mass [mg]: by the model as given, nan where that is not known.
    """

    summary: SummaryValues
    moment: int
    curves: SampleCurves
    nominal_mass: float

    @property
    def band(self) -> Signal:
        """Half the 95 % band of its rate [mm3/ms], (n,): the rate is as sure as the mass."""
        share = 1.96 * self.summary.mass_sigma / self.summary.mass if self.summary.mass else np.nan
        return (np.abs(self.curves.rate) * share).astype(np.float32)
