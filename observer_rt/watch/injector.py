"""Everything seen of one injector: its last injections, its state, and what is wrong with it now."""

from collections import deque
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.links.link import BusFrame
from observer_rt.bus.mapping.bus_map import BusMap, map_bus
from observer_rt.bus.mapping.output_messages import StatusValues, SummaryValues
from observer_rt.config.bench import Bench
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MILLIGRAM, MILLISECOND, MM3_PER_MS
from observer_rt.observer.stream.state import Reason, State
from observer_rt.service.watch.arrivals import SECOND, Arrivals, message_text
from observer_rt.service.watch.input_watch import LASTING
from observer_rt.service.watch.silence import TOLD
from observer_rt.service.words import REASONS, STATES, TOPICS, Topic, is_good
from observer_rt.watch.results import Rates, ResultReader, SampleCurves, SeenInjection
from observer_rt.watch.samples import CountShift, InjectionModel, InputSamples, PublishedRates, best_place

_NO_DAEMON = "start `observer-rt run` for this bench, or see to its bus"


@dataclass(frozen=True)
class Fault:
    """Something that is wrong since a moment [ns since 1970]."""

    what: str
    since: int
    remedy: str


class FaultWatch:
    """Looks at one injector's messages and status now and then."""

    def __init__(self, bus: BusMap, arrivals: Arrivals) -> None:
        self._bus = bus
        self._arrivals = arrivals
        self._condition: tuple[int, int] | None = None
        self._since = 0

    def look(self, now: int, status: StatusValues | None) -> tuple[Fault, ...]:
        """All that is wrong at a time [ns since 1970], the likely cause first."""
        return (*self._silences(now), *self._said(now, status))

    def _silences(self, now: int) -> list[Fault]:
        """Messages that stay away."""
        arrivals = self._arrivals
        silent = [
            Fault(
                f"{source.text}: no frame for {arrivals.silence(source, now):.0f} s",
                now - round(arrivals.silence(source, now) * SECOND),
                TOPICS[Topic.INPUT].remedy,
            )
            for source in arrivals.sources
            if arrivals.silence(source, now) > max(TOLD, source.patience)
        ]
        since = arrivals.last_result(self._bus.status.layout)
        if now - since > TOLD * SECOND:
            text = message_text(self._bus, self._bus.status.layout)
            silent.insert(0, Fault(f"{text}: no frame for {(now - since) / SECOND:.0f} s", since, _NO_DAEMON))
        return silent

    def _said(self, now: int, status: StatusValues | None) -> list[Fault]:
        """What the observer says of itself."""
        if status is None:
            return []
        state, reason = State(int(status.state)), Reason(int(status.reason))
        if (state, reason) != self._condition:
            self._condition, self._since = (state, reason), now
        if is_good(state) or now - self._since < LASTING * SECOND:
            return []
        words = REASONS[reason] if reason is not Reason.NONE else STATES[state]
        name = reason.name if reason is not Reason.NONE else state.name
        return [Fault(f"{name}: {words.what}", self._since, words.remedy)]


KEPT = 1000  # injections
Key: TypeAlias = tuple[int, int, bool]
"""Of a frame: its bus, its identifier, whether that is extended."""


@dataclass(frozen=True)
class Seen:
    """What is known of an injector at a moment: of its last injections the newest last."""

    name: str
    injections: tuple[SeenInjection, ...]
    status: StatusValues | None
    faults: tuple[Fault, ...]
    lost: int
    """Frames of its results that were refused, and those the observer says it lost."""


class WatchedInjector:
    """Takes the frames of its buses in; not to be used by several threads at once."""

    def __init__(self, alone: Bench) -> None:
        """alone: the bench with this injector only."""
        fitted = alone.injector
        self.bus: BusMap = map_bus(alone)
        self.name = fitted.name
        self.rate_hz = fitted.config.sampling.rate_hz
        self._results = ResultReader(self.bus)
        self._samples = InputSamples(fitted, self.bus)
        self._rates = PublishedRates()
        self._are_counted = self._samples.are_counted
        self._count_shift = CountShift(self._samples.lookahead, self.rate_hz)
        self._model = InjectionModel(fitted)
        self._arrivals = Arrivals(self.bus)
        self._faults = FaultWatch(self.bus, self._arrivals)
        self._status: StatusValues | None = None
        self._injections: deque[SeenInjection] = deque(maxlen=KEPT)

    @property
    def keys(self) -> frozenset[Key]:
        """Of the frames that are to be taken."""
        layouts = (*self.bus.received, *self.bus.sent)
        return frozenset((each.bus, each.frame_id, each.is_extended) for each in layouts)

    def prepare(self) -> None:
        """Compile, or load, what frames will need, before they come."""
        self._samples.prepare()
        self._model(np.zeros(2), np.zeros(2))

    def begin(self, now: int) -> None:
        """Listening begins at a time [ns since 1970]."""
        self._arrivals.begin(now)

    def take(self, came: BusFrame, now: int) -> None:
        """A frame of any bus, that came at a time [ns since 1970]."""
        frame = came.frame
        self._arrivals.note(came.bus, frame.frame_id, frame.is_extended, now)
        if self._samples.take(came):
            return
        result = self._results.read(came)
        if isinstance(result, Rates):
            self._rates.take(result)
            if self._are_counted:
                self._count_shift.note(result.index + result.rates.size - 1, self._samples.newest)
        elif isinstance(result, SummaryValues):
            if not self._injections or result != self._injections[-1].summary:
                self._injections.append(self._seen(result, now))
        elif isinstance(result, StatusValues):
            self._status = result

    def seen(self, now: int) -> Seen:
        """All of it at a time [ns since 1970]."""
        status = self._status
        said = 0.0 if status is None else np.nansum([status.dropped_frames, status.lost_samples])
        return Seen(
            self.name,
            tuple(self._injections),
            status,
            self._faults.look(now, status),
            self._results.refused + int(said),
        )

    def _seen(self, summary: SummaryValues, now: int) -> SeenInjection:
        without_curves = SeenInjection(summary, now, _no_curves(), np.nan)
        ahead = self._ahead(summary)
        if ahead is None:
            return without_curves
        rows = self._samples.between(int(summary.sample_index) - ahead, int(summary.end_index) - ahead)
        if not len(rows):
            return without_curves
        rail, lift = rows["rail_pressure"].copy(), rows["needle_lift"].copy()
        nominal = self._model(rail, lift)
        worn = self._model(rail, lift, *_wear(summary))
        c = self._model.coefficients
        place = (rows["index"] - rows["index"][0]).astype(np.float64)

        def in_mpa(values: NDArray[np.float64]) -> NDArray[np.float32]:
            return ((values * c.pressure_scale + c.chamber_pressure) / MEGAPASCAL).astype(np.float32)

        curves = SampleCurves(
            time=(place / self.rate_hz / MILLISECOND).astype(np.float32),
            rail_pressure=in_mpa(rail),
            needle_lift=(lift / MICROMETRE).astype(np.float32),
            line_pressure=in_mpa(rows["line_pressure"]),
            rate=self._rates.at(rows["index"] + ahead).astype(np.float32),
            nominal=nominal.rate.astype(np.float32),
            phi=worn.phi.astype(np.float32),
        )
        volume = float(np.trapezoid(nominal.rate * MM3_PER_MS)) / self.rate_hz
        return SeenInjection(summary, now, curves, volume * c.density / MILLIGRAM)

    def _ahead(self, summary: SummaryValues) -> int | None:
        """By how many samples the observer's count is ahead of ours; None: it cannot be told of this injection."""
        if not self._are_counted:
            return 0
        candidates = self._count_shift.candidates
        if not candidates:
            return None
        start, end = int(summary.sample_index), int(summary.end_index)
        published = self._rates.at(np.arange(start, end + 1))
        rows = self._samples.between(start - candidates[-1], end - candidates[0])
        if len(rows) != published.size + len(candidates) - 1:
            return None
        modelled = self._model(rows["rail_pressure"].copy(), rows["needle_lift"].copy(), *_wear(summary))
        place = best_place(published, modelled.rate)
        return None if place is None else candidates[-1] - place


def _wear(summary: SummaryValues) -> tuple[float, float]:
    """Of nozzle and seat; none where it is not known."""
    nozzle, seat = np.nan_to_num([summary.nozzle_wear, summary.seat_wear]).tolist()
    return nozzle, seat


def _no_curves() -> SampleCurves:
    nothing = np.empty(0, np.float32)
    return SampleCurves(nothing, nothing, nothing, nothing, nothing, nothing, np.empty((3, 0), np.float32))
