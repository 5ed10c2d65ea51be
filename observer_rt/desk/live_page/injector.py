"""Everything seen of one injector: its last injections, its state, and what is wrong with it now."""

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.links.link import BusFrame
from observer_rt.bus.mapping.bus_map import BusMap, map_bus
from observer_rt.bus.mapping.output_signals import StatusValues, SummaryValues
from observer_rt.config.bench import Bench, BenchInjector
from observer_rt.daemon.input_monitoring.arrivals import SECOND, Arrivals, message_text
from observer_rt.daemon.input_monitoring.input_watch import LASTING
from observer_rt.daemon.input_monitoring.silence import REPORTED_AFTER
from observer_rt.desk.live_page.samples import (
    CountShift,
    InjectionModel,
    InputSamples,
    PublishedRates,
    Rates,
    ResultReader,
    SampleCurves,
    SeenInjection,
    best_place,
)
from observer_rt.engine.stream.state import Reason, State
from observer_rt.engine.words import REASONS, STATES, TOPICS, Topic, is_good
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MILLIGRAM, MILLISECOND, MM3_PER_MS

_OF_INPUTS = (
    Reason.INPUT_TIMEOUT,
    Reason.INPUT_STALE,
    Reason.STARTING,
)  # what the observer says of messages away
_NO_DAEMON = "start `observer-rt run` for this bench, or see to its bus"
SILENT_AFTER = 1.0  # s without a status, after which nothing of the observer is of now
_PERIODS = 3  # of its status, if they are longer
KEPT = 1000  # injections
HISTORY = np.dtype([(name, np.float64) for name in (*SummaryValues._fields, "nominal_mass")])


@dataclass(frozen=True)
class Fault:
    """Something that is wrong since a moment [ns since 1970]; parts: the messages it shows in, if several."""

    what: str
    since: int
    remedy: str
    parts: tuple[str, ...] = ()


class FaultWatch:
    """Looks at one injector's messages and status now and then."""

    def __init__(self, alone: Bench, bus: BusMap, arrivals: Arrivals) -> None:
        self._bus = bus
        self._arrivals = arrivals
        period = alone.injector.config.outputs.status_period_ms * MILLISECOND
        self._patience = round(max(SILENT_AFTER, _PERIODS * period) * SECOND)
        self._condition: tuple[int, int] | None = None
        self._since = 0

    def silent_since(self, now: int) -> int | None:
        """Since when the observer itself stays away [ns since 1970]; None: it is there."""
        last = self._arrivals.last_result(self._bus.status.layout)
        return last if now - last > self._patience else None

    def look(self, now: int, status: StatusValues | None) -> tuple[Fault, ...]:
        """All that is wrong at a time [ns since 1970], one for each cause, the likely one first."""
        away, silent, said = self._no_status(now), self._silence(now), self._said(now, status)
        if away or (silent and status is not None and int(status.reason) in _OF_INPUTS):
            said = []
        return (*away, *silent, *said)

    def _silence(self, now: int) -> list[Fault]:
        """Messages that stay away, together: most often they have one device, cable or bus."""
        ages = {source: self._arrivals.silence(source, now) for source in self._arrivals.sources}
        silent = {source: age for source, age in ages.items() if age > max(REPORTED_AFTER, source.patience)}
        if not silent:
            return []
        texts = tuple(f"{source.text}: no frame for {age:.0f} s" for source, age in silent.items())
        since = now - round(max(silent.values()) * SECOND)
        remedy = TOPICS[Topic.INPUT].remedy
        if len(texts) == 1:
            return [Fault(texts[0], since, remedy)]
        sampled = {source for source in ages if source.streams}
        count = "any input" if sampled <= silent.keys() else f"{len(texts)} messages"
        return [Fault(f"no frame of {count} for {min(silent.values()):.0f} s", since, remedy, texts)]

    def _no_status(self, now: int) -> list[Fault]:
        """The observer itself stays away."""
        since = self.silent_since(now)
        if since is None:
            return []
        text = message_text(self._bus, self._bus.status.layout)
        return [Fault(f"{text}: no frame for {(now - since) / SECOND:.0f} s", since, _NO_DAEMON)]

    def _said(self, now: int, status: StatusValues | None) -> list[Fault]:
        """Faults that the observer's status reports."""
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


@dataclass(frozen=True)
class Seen:
    """Snapshot of an injector: its last injections, the newest last, its status and faults."""

    name: str
    injections: tuple[SeenInjection, ...]
    history: NDArray[np.void]
    """Remembered injections (n,), dtype `HISTORY`: their summaries, and the mass by the model as given [mg]."""
    status: StatusValues | None
    faults: tuple[Fault, ...]
    lost: int
    """Frames of its results that were refused, and those the observer says it lost."""
    silent_since: int | None = None
    """Since when the observer itself stays away [ns since 1970]: all else is of before."""


class WatchedInjector:
    """Takes the frames of its buses in; not to be used by several threads at once."""

    def __init__(self, alone: Bench) -> None:
        """alone: the bench with this injector only."""
        fitted = alone.injector
        self.bus: BusMap = map_bus(alone)
        self.name = fitted.name
        self.keys = frozenset(each.key for each in (*self.bus.received, *self.bus.sent))
        """Keys of the frames that are to be taken, as by `frame_key`."""
        self._rate_hz = fitted.config.sampling.rate_hz
        self._results = ResultReader(self.bus)
        self._samples = InputSamples(fitted, self.bus)
        self._rates = PublishedRates()
        self._count_shift = CountShift(self._samples.lookahead, self._rate_hz)
        self._model = InjectionModel(fitted)
        self._arrivals = Arrivals(self.bus)
        self._faults = FaultWatch(alone, self.bus, self._arrivals)
        self._status: StatusValues | None = None
        self._injections: deque[SeenInjection] = deque(maxlen=KEPT)
        self._history = np.empty(0, HISTORY)

    def begin(self, now: int) -> None:
        """Listening begins at a time [ns since 1970]."""
        self._arrivals.begin(now)

    def use_model(self, fitted: BenchInjector) -> None:
        """Compare injections with the model that the bench file names now; which also mends what is recorded."""
        self._model = InjectionModel(fitted)
        self._samples = InputSamples(fitted, self.bus)
        self._count_shift = CountShift(self._samples.lookahead, self._rate_hz)

    def take(self, came: BusFrame, now: int) -> None:
        """A frame of any bus, that came at a time [ns since 1970]."""
        frame = came.frame
        self._arrivals.note(came.bus, frame.frame_id, frame.is_extended, now)
        if self._samples.take(came):
            return
        result = self._results.read(came)
        if isinstance(result, Rates):
            self._rates.take(result)
            if self._samples.are_counted:
                self._count_shift.note(result.index + result.rates.size - 1, self._samples.newest)
        elif isinstance(result, SummaryValues):
            if not self._injections or result != self._injections[-1].summary:
                injection = self._seen(result, now)
                self._injections.append(injection)
                row = np.array([(*result, injection.nominal_mass)], HISTORY)
                self._history = np.concatenate([self._history[1 - KEPT :], row])
        elif isinstance(result, StatusValues):
            self._status = result

    def seen(self, now: int) -> Seen:
        """All of it at a time [ns since 1970]."""
        status = self._status
        said = 0.0 if status is None else np.nansum([status.dropped_frames, status.lost_samples])
        faults = self._faults.look(now, status)
        lost = self._results.refused + int(said)
        injections, silent_since = tuple(self._injections), self._faults.silent_since(now)
        return Seen(self.name, injections, self._history, status, faults, lost, silent_since)

    def _seen(self, summary: SummaryValues, now: int) -> SeenInjection:
        """An injection with the samples that belong to it, where these were received."""
        ahead = self._ahead(summary)
        if ahead is None:
            return SeenInjection(summary, now)
        rows = self._samples.between(int(summary.sample_index) - ahead, int(summary.end_index) - ahead)
        if not len(rows):
            return SeenInjection(summary, now)
        rail, lift = rows["rail_pressure"].copy(), rows["needle_lift"].copy()
        nominal = self._model(rail, lift)
        worn = self._model(rail, lift, *_wear(summary))
        c = self._model.coefficients
        curves = (
            (rows["index"] - rows["index"][0]) / (self._rate_hz * MILLISECOND),
            (rail * c.pressure_scale + c.chamber_pressure) / MEGAPASCAL,
            lift / MICROMETRE,
            (rows["line_pressure"] * c.pressure_scale + c.chamber_pressure) / MEGAPASCAL,
            self._rates.at(rows["index"] + ahead),
            nominal.rate,
            *worn.phi,
        )
        volume = float(np.trapezoid(nominal.rate * MM3_PER_MS)) / self._rate_hz
        return SeenInjection(
            summary,
            now,
            SampleCurves._make(each.astype(np.float32) for each in curves),
            volume * c.density / MILLIGRAM,
            float(np.sqrt(np.nanmean((rows["line_pressure"] - nominal.line_pressure) ** 2)))
            * (c.pressure_scale / MEGAPASCAL),
            self._model.name,
        )

    def _ahead(self, summary: SummaryValues) -> int | None:
        """By how many samples the observer's count is ahead of ours; None: not known of this injection."""
        if not self._samples.are_counted:
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
    """Wear of nozzle and seat; none where it is not known."""
    nozzle, seat = np.nan_to_num([summary.nozzle_wear, summary.seat_wear]).tolist()
    return nozzle, seat
