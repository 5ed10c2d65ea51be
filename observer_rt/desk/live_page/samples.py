"""Samples an observer is given, rates it publishes, by sample index, and what the model says of them.

Inputs without an index are counted by both, each since it began to listen. What the observer publishes gives the
difference: a rate cannot come before its samples, which bounds it to some milliseconds, and within these the rate
that the model makes of the samples received here fits the published one at one place only.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.can_frame import frame_key
from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.bus.links.link import BusFrame
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.bus.mapping.output_messages import HEADER_SIGNALS, OutputMessage, RateMessage
from observer_rt.bus.mapping.output_signals import StatusValues, SummaryValues
from observer_rt.bus.mapping.timing import Numbering
from observer_rt.config.bench import BenchInjector
from observer_rt.core.frames.frames import carries, check_frame, decode_signals
from observer_rt.core.model.laws import normalised_area
from observer_rt.core.model.model import rest_state
from observer_rt.core.stream.stream import RING, dead_band
from observer_rt.engine.service.constants import bench_constants, configured_noise
from observer_rt.engine.service.core import Core
from observer_rt.engine.stream.follower import Follower
from observer_rt.foundation.units import MM3_PER_MS
from observer_rt.model.effective import Coefficients
from observer_rt.model.network import constant_network

Payload: TypeAlias = NDArray[np.uint8]
Signal = NDArray[np.float32]
_INDEX = 0xFFFFFFFF  # bits of a sample index as it is sent
SLOWEST = 5e-3  # s from a sample to its rate, of the promptest frames
_FRAMES = 100  # of rates, one of which was prompt
_ALIKE = 0.9  # share of the squares of a published rate that the model has at its place, but for a factor
_HALF, _WHOLE = 0x80000000, 0x100000000  # indices are sent in 32 bits


@dataclass(frozen=True, eq=False)
class Rates:
    """Injection rates of consecutive samples [mm3/ms], (n,), nan: not available; index: of the first."""

    index: int
    rates: NDArray[np.float64]


Result: TypeAlias = Rates | SummaryValues | StatusValues


class ResultReader:
    """Reads the result frames of one injector. Frames that its protection refuses are counted and left out."""

    def __init__(self, bus: BusMap) -> None:
        self.refused = 0
        """Frames of wrong length or checksum."""
        self._messages: dict[int, tuple[MessageLayout, Callable[[Payload], Result | None]]] = {}
        if bus.rate is not None:
            self._messages[bus.rate.layout.key] = bus.rate.layout, _rates_of(bus.rate)
        for message, kind in ((bus.summary, SummaryValues), (bus.status, StatusValues)):
            self._messages[message.layout.key] = message.layout, _values_of(message, kind)

    def read(self, came: BusFrame) -> Result | None:
        """Decodes a result frame; None where it is none of these, is refused, or more pages are to come.

        All numbers of summary and status are floats, nan where they are not available.
        """
        frame = came.frame
        found = self._messages.get(frame_key(frame.frame_id, frame.is_extended, came.bus))
        if found is None:
            return None
        layout, result_of = found
        payload = np.frombuffer(frame.payload, np.uint8)
        if payload.size < layout.length or not check_frame(payload, layout.length, layout.protection):
            self.refused += 1
            return None
        return result_of(payload)


def _rates_of(message: RateMessage) -> Callable[[Payload], Rates | None]:
    page = message.page
    index_at = page.names.index(HEADER_SIGNALS[0]) if HEADER_SIGNALS[0] in page.names else None

    def read(payload: Payload) -> Rates | None:
        values = np.empty(page.table.size)
        decode_signals(payload, page.table, values)
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
            if carries(payload, page.selection, 0, page.selection.conditions.size):
                values = np.empty(page.table.size)
                decode_signals(payload, page.table, values)
                collected[page.places] = values
                missing.discard(number)
        if missing:
            return None
        missing.update(range(len(message.pages)))
        return kind._make(collected.tolist())

    return read


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

    nominal_mass [mg]: by the model as given, nan where that is not known; gap [MPa]: root mean square of what the
    measured line pressure differs from that model's; model: file name of that model.
    """

    summary: SummaryValues
    moment: int
    curves: SampleCurves | None = None
    nominal_mass: float = np.nan
    gap: float = np.nan
    model: str = ""


class InputSamples:
    """The last samples of one injector, checked, decoded and joined as the daemon does it, but not observed."""

    def __init__(self, fitted: BenchInjector, bus: BusMap) -> None:
        self._compiled = Core(fitted, bus, learning=False).compiled
        keeping = self._compiled.pipeline.keeping
        numbering = keeping.timing[keeping.memory[0]["leading"]]["numbering"]
        self.are_counted = bool(numbering != Numbering.INDEX)
        """Whether their index is not sent, but counted since the first one came."""
        self._keys = set(bus.inputs.messages["key"][: len(bus.input_layouts)].tolist())

    def take(self, came: BusFrame) -> bool:
        """Take a frame; one that brings no samples is passed over: False."""
        key = frame_key(came.frame.frame_id, came.frame.is_extended, came.bus)
        if key not in self._keys:
            return False
        self._compiled.listen(key, np.frombuffer(came.frame.payload, np.uint8), came.frame.stamp_ns)
        return True

    @property
    def received(self) -> int:
        """Number of samples received so far."""
        return int(self._compiled.observer.memory[0]["positions"]["received"])

    @property
    def newest(self) -> int:
        """Index of the last sample received."""
        return int(self._compiled.observer.ring["index"][(self.received - 1) % RING])

    @property
    def lookahead(self) -> int:
        """Samples that an observer must know beyond one."""
        return int(self._compiled.observer.constants.timing.lookahead)

    def between(self, start: int, end: int) -> NDArray[np.void]:
        """Samples with an index as sent in [start, end], dtype `sample_dtype`; only the newest are remembered."""
        received, ring = self.received, self._compiled.observer.ring
        index = ring["index"] & _INDEX
        place = np.flatnonzero((index >= start) & (index <= end))
        if received < RING:
            place = place[place < received]
        age = (received - 1 - place) % RING
        return ring[place[np.argsort(age)[::-1]]]


class PublishedRates:
    """The last published rates [mm3/ms]."""

    def __init__(self) -> None:
        self._index = np.full(RING, -1, np.int64)
        self._rate = np.full(RING, np.nan)

    def take(self, rates: Rates) -> None:
        """Take the rates of a frame."""
        index = (rates.index + np.arange(rates.rates.size)) & _INDEX
        self._index[index % RING] = index
        self._rate[index % RING] = rates.rates

    def at(self, index: NDArray[np.int64]) -> NDArray[np.float64]:
        """Rates [mm3/ms] at sample indices (n,); nan: not published, or long ago."""
        sent = index & _INDEX
        place = sent % RING
        return np.where(self._index[place] == sent, self._rate[place], np.nan)


class CountShift:
    """By how many samples the observer's count is ahead of ours."""

    def __init__(self, lookahead: int, rate_hz: float) -> None:
        """lookahead: samples the observer must know beyond one before it publishes its rate."""
        self._reach = lookahead + round(SLOWEST * rate_hz)
        self._ahead: deque[int] = deque(maxlen=_FRAMES)

    def note(self, published: int, received: int) -> None:
        """Rates came up to the observer's sample `published` when ours were received up to `received`."""
        self._ahead.append((published - received + _HALF) % _WHOLE - _HALF)

    @property
    def candidates(self) -> range:
        """The shifts that are possible; none before rates came."""
        least = max(self._ahead, default=0)
        return range(least, least + self._reach + 1) if self._ahead else range(0)


def best_place(published: NDArray[np.float64], modelled: NDArray[np.float64]) -> int | None:
    """Place in modelled rates (n,) of a stretch of published ones (m,), m <= n, nan where none were published.

    Wear is a factor. None where nothing was injected, or no place is like it.
    """
    is_known = np.isfinite(published)
    rates = np.where(is_known, published, 0.0)
    squares = float(rates @ rates)
    if squares == 0.0:
        return None
    common = np.correlate(modelled, rates, "valid")
    own = np.correlate(modelled**2, is_known.astype(np.float64), "valid")
    alike = np.clip(common, 0.0, None) ** 2 / (squares * np.clip(own, 1e-9 * squares, None))
    best = int(np.argmax(alike))
    return best if alike[best] > _ALIKE else None


class Modelled(NamedTuple):
    """Modelled rate [mm3/ms] (n,) and phi [1/s] (3, n), 0 with the needle shut, and normalised line pressure (n,)."""

    rate: NDArray[np.float64]
    phi: NDArray[np.float64]
    line_pressure: NDArray[np.float64]


class InjectionModel:
    """Runs the model of an injector open loop over the samples of an injection, from standstill."""

    def __init__(self, fitted: BenchInjector) -> None:
        self.name = fitted.parameters_path.name
        self._constants = bench_constants(fitted)
        self.coefficients: Coefficients = self._constants.coefficients
        self._dead_band = dead_band(configured_noise(fitted).needle_lift)[0]

    def __call__(
        self,
        rail_pressure: NDArray[np.float64],
        needle_lift: NDArray[np.float64],
        nozzle_wear: float = 0.0,
        seat_wear: float = 0.0,
    ) -> Modelled:
        """rail_pressure (n,), normalised by (24), of which the first is the line's at rest; needle_lift (n,) [m].

        nozzle_wear v_H, seat_wear v_S: relative changes of the flows, (27).
        """
        c, n = self.coefficients, needle_lift.size
        lift = np.where(needle_lift < self._dead_band, 0.0, needle_lift)
        area = np.array([normalised_area(each, c.seat) for each in lift.tolist()])
        state = np.zeros(c.states)
        rest_state(state, float(rail_pressure[0]), c)
        follower = Follower(self._constants, constant_network(nozzle_wear, seat_wear))
        phi, line_pressure = np.empty((3, n)), np.empty(n)
        follower.begin(state)
        resting = np.cumsum(area) == 0.0  # once it was open, the sac drains by itself
        inputs = np.column_stack([rail_pressure, area])
        rate = follower.run(inputs, resting, phi=phi, line_pressure=line_pressure)
        return Modelled(rate / MM3_PER_MS, phi, line_pressure)
