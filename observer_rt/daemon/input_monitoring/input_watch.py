"""All watches of a core together, live or over a log: its inputs and their units, other senders, its state."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.database.e2e import E2EState
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.bus.mapping.input_tables import ROLES
from observer_rt.config.bench import BenchInjector
from observer_rt.config.signals import Role
from observer_rt.daemon.input_monitoring.arrivals import SECOND, Arrivals, WatchedMessage, message_text
from observer_rt.daemon.input_monitoring.frame_watch import FrameWatch, RateWatch
from observer_rt.daemon.input_monitoring.silence import Samples, SilenceWatch, ValueWatch
from observer_rt.engine.reports.news import Notice
from observer_rt.engine.service.core import Core
from observer_rt.engine.service.injector import configured_noise
from observer_rt.engine.signal_survey import OPEN, SignalSurvey, Survey, implausible, swapped
from observer_rt.engine.stream.standstill import LiftFigures
from observer_rt.engine.stream.state import Reason, State
from observer_rt.engine.words import Topic, is_good, named
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE

HUNG = 5.0  # s, of learning from one event
LOOKS = 10  # whose values are judged together
IN_A_ROW = 2  # times that the same is found, before it is reported
SWAPPED = "swapped"  # what is wrong with two signals together
REMEDY = "stop the other daemon or replay; two on one bus need messages of their own in [outputs]"
REPORTED_EVERY = 30.0  # s between two reports of the same
PERIOD = 100_000_000  # ns between two looks
MOST_SAMPLES = 1024  # of a look, which the loop waits for

# s that a state must last to be reported: a source that sends windows changes it at each of them.
LASTING = 1.0
_ABOUT_INPUTS = (Reason.INPUT_TIMEOUT, Reason.INPUT_STALE, Reason.STARTING)
_Standing = tuple[State, tuple[Reason, ...], tuple[str, ...]]


class UnitWatch:
    """Judges the values of some seconds together, as files are judged when they are read."""

    def __init__(self, sources: Sequence[WatchedMessage]) -> None:
        self._named = {role: f"{source.text}: {role}" for source in sources for role in source.roles}
        self._named[SWAPPED] = "rail_pressure and line_pressure: each"
        self._begin()
        self._suspected: Mapping[str, str] = {}
        self._times = 0  # in a row that this was found
        self.reported: Mapping[str, str] = {}
        """Faults by signal, as reported, in words with their remedy."""

    def look(self, newest: NDArray[np.float64], samples: Samples) -> list[Notice]:
        """Notices; newest (3,) [SI]: last value of every role; samples: since the last look."""
        for role, value in zip(ROLES, newest.tolist(), strict=True):
            self._take(self._survey, role, np.array([value]))
        self._take(self._survey, Role.NEEDLE_LIFT, samples[Role.NEEDLE_LIFT])
        for role in (Role.RAIL_PRESSURE, Role.LINE_PRESSURE):
            self._take(self._swings, role, samples[role])
        self._looks += 1
        if self._looks < LOOKS:
            return []
        odd = {
            each.signal: f"{self._named[each.signal]} {each.problem}\n  remedy: {each.remedy}"
            for each in reversed([*implausible(self._survey)])  # of several of a signal the first
        }
        if not odd and (mixed_up := self._swapped()):
            odd = {SWAPPED: mixed_up}
        self._begin()
        self._times = self._times + 1 if odd.keys() == self._suspected.keys() else 1
        self._suspected = odd
        if self._times < IN_A_ROW or odd.keys() == self.reported.keys():
            return []
        before, self.reported = self.reported, odd
        notices = [Notice(Topic.VALUE, text) for signal, text in odd.items() if signal not in before]
        over = [signal for signal in before if signal not in odd]
        return notices + [
            Notice(Topic.VALUE, f"{self._named[signal]} is in its range again", is_over=True)
            for signal in over
        ]

    def _begin(self) -> None:
        self._survey, self._swings = (
            Survey({role.value: SignalSurvey() for role in ROLES}) for _ in range(2)
        )
        self._looks = 0

    def _swapped(self) -> str:
        """Whether rail and line pressure are swapped, in words; as before where no injection tells."""
        if self._survey.signals[Role.NEEDLE_LIFT.value].highest < OPEN:
            return self._suspected.get(SWAPPED, "")
        return "\n  remedy: ".join(swapped(self._swings) or ())

    def _take(self, survey_of_all: Survey, role: Role, values: NDArray[np.float64]) -> None:
        values = values[np.isfinite(values)]
        if values.size:
            survey = survey_of_all.signals[role.value]
            survey.lowest = min(survey.lowest, float(values.min()))
            survey.highest = max(survey.highest, float(values.max()))
            survey.total += float(values.sum())
            survey.count += values.size


class SenderWatch:
    """Reports another sender when its first frame comes, and again from time to time while it goes on."""

    def __init__(self, bus: BusMap, arrivals: Arrivals) -> None:
        self._bus = bus
        self._arrivals = arrivals
        self._reported = 0  # frames
        self._next = 0
        self._is_contested = False

    def look(self, now: int) -> list[Notice]:
        """Notices at a time [ns]."""
        frames = self._arrivals.foreign_frames
        if self._is_contested and not self._arrivals.is_contested(now):
            self._is_contested = False
            return [Notice(Topic.SENDER, f"the other sender is silent after {frames} frames", is_over=True)]
        if frames == self._reported or now < self._next:
            return []
        self._is_contested = True
        self._reported, self._next = frames, now + round(REPORTED_EVERY * SECOND)
        names = ", ".join(message_text(self._bus, layout) for layout, _ in self._arrivals.foreign)
        text = f"another node sends {names}: {frames} frames so far\n  remedy: {REMEDY}"
        return [Notice(Topic.SENDER, text)]


class ProtectionWatch:
    """Reports messages whose end-to-end protection is INVALID, so that none of its values are taken."""

    def __init__(self, bus: BusMap, arrivals: Arrivals) -> None:
        keys = bus.inputs.messages["key"].tolist()
        self._numbers = {source: keys.index(source.layout.key) for source in arrivals.sources}
        self.reported: set[WatchedMessage] = set()
        """Whose protection is INVALID, as reported."""

    def look(self, states: Sequence[int]) -> Iterator[Notice]:
        """Notices; states: `E2EState` of every input message."""
        for source, number in self._numbers.items():
            is_invalid = states[number] == E2EState.INVALID
            if is_invalid == (source in self.reported):
                continue
            self.reported ^= {source}
            fault = "its end-to-end protection is INVALID, its values are not taken"
            remedy = "another sender? a disturbed bus? E2EProfile and data id of the database? limits: [e2e]"
            if is_invalid:
                yield Notice(Topic.INPUT, f"{source.text}: {fault}\n  remedy: {remedy}")
            else:
                yield Notice(
                    Topic.INPUT, f"{source.text}: its end-to-end protection is VALID again", is_over=True
                )


class InputWatch:
    """Reports faults of the inputs of a core, by message and identifier."""

    def __init__(self, fitted: BenchInjector, bus: BusMap, core: Core) -> None:
        self.arrivals = Arrivals(bus)
        self._core = core
        self._silence = SilenceWatch(self.arrivals)
        self._values = ValueWatch(bus, configured_noise(fitted))
        self._units = UnitWatch(self.arrivals.sources)
        self._lift = LiftWatch()
        self._protection = ProtectionWatch(bus, self.arrivals)
        self._senders = SenderWatch(bus, self.arrivals)
        rate = fitted.config.sampling.rate_hz
        self._faulty, self._rate = FrameWatch(self.arrivals, rate), RateWatch(rate)
        self._seen = 0
        self._frames = 0

    def look(self, now: int) -> list[Notice]:
        """Notices at a time [ns] of the arrivals' clock; to be called every `PERIOD`."""
        core = self._core
        notices = [*self._protection.look(core.protection)]
        notices += self._silence.look(now, core.progress, self._protection.reported)
        notices += self._faulty.look(core.counters, bool(self._protection.reported))
        notices += self._rate.look(core.timing, core.state[1])
        has_frames = core.frames_taken > self._frames
        self._frames = core.frames_taken
        if has_frames and self.arrivals.is_complete and not self.arrivals.stale(now):
            samples = core.inputs(self._seen, MOST_SAMPLES)
            self._seen = core.processed
            notices += self._values.look(core.newest, samples)
            notices += self._units.look(core.newest, samples)
        return [*notices, *self._lift.look(core.lift), *self._senders.look(now)]

    @property
    def causes(self) -> tuple[str, ...]:
        """Lasting faults of the inputs, which may be why nothing is valid."""
        return (*self._units.reported.values(), *filter(None, [self._rate.reported]))


class RestartWatch:
    """Reports a device that begins its sample index anew."""

    def __init__(self, arrivals: Arrivals) -> None:
        self._sources = arrivals.sources
        self._restarts = 0
        self._before: list[int] = []

    def look(self, progress: list[int], restarts: int) -> list[Notice]:
        """Notices; progress: as of `SilenceWatch`, restarts: so far."""
        before, self._before = self._before, progress
        if restarts == self._restarts:
            return []
        self._restarts = restarts
        back = [
            f"{source.text}: sample index {before[stream]} -> {progress[stream]}"
            for source in self._sources
            for stream in source.streams[:1]
            if before and progress[stream] < before[stream]
        ]
        change = "; ".join(back) or "sample index begins anew"
        remedy = "nothing, if that was meant; else check its power supply"
        return [Notice(Topic.INPUT, f"a measuring device was restarted: {change}\n  remedy: {remedy}")]


class LearningWatch:
    """Reports learning from an event that comes to no end."""

    def __init__(self) -> None:
        self._event: int | None = None
        self._since = 0
        self._is_reported = False

    def look(self, now: int, event: int | None) -> list[Notice]:
        """Notices at a monotonic time [ns]; event: by its number, that is being learned from, None: none is."""
        if event != self._event or event is None:
            was_reported, self._is_reported = self._is_reported, False
            self._event, self._since = event, now
            return [Notice(Topic.LEARNING, "learning goes on", is_over=True)] if was_reported else []
        if self._is_reported or now - self._since < HUNG * 1e9:
            return []
        self._is_reported = True
        text = (
            f"learning from an event has taken {HUNG:g} s; events are examined meanwhile, nothing is learned"
        )
        remedy = "give the process a processor; if it stays so, restart it"
        return [Notice(Topic.LEARNING, f"{text}\n  remedy: {remedy}")]


class LiftWatch:
    """Looks at the figures of the lift sensor."""

    def __init__(self) -> None:
        self._before = LiftFigures()

    def look(self, figures: LiftFigures) -> list[Notice]:
        """Notices."""
        before, self._before = self._before, figures
        notices = []
        is_pressed = figures.crosstalk != 0.0
        if is_pressed != (before.crosstalk != 0.0):
            finding = "the line pressure shows in it no more"
            if is_pressed:
                size = figures.crosstalk * 10 * MEGAPASCAL / MICROMETRE
                finding = (
                    f"the line pressure shows in it, {size:.2g} um per 10 MPa, which is taken out\n"
                    "  remedy: none is needed; check mounting, cable and ground of the needle-lift sensor"
                )
            notices.append(Notice(Topic.VALUE, f"needle_lift: {finding}", not is_pressed))
        if figures.is_to_scale != before.is_to_scale:
            finding = "as the injector file says"
            if not figures.is_to_scale:
                finding = (
                    f"not at seat.max_lift = {figures.stop / MICROMETRE:.0f} um of the injector file\n"
                    "  remedy: calibrate the needle-lift sensor (or correct its factor), or correct seat.max_lift"
                )
            at = f"{figures.at_stop / MICROMETRE:.0f} um"
            text = f"needle_lift: long openings stay at {at}, {finding}"
            notices.append(Notice(Topic.VALUE, text, figures.is_to_scale))
        return notices


class StateWatch:
    """Reports the state of the service, with the ages of the inputs where these are the reason."""

    def __init__(self, arrivals: Arrivals) -> None:
        self._arrivals = arrivals
        self._now: _Standing | None = None
        self.since = 0
        """When the state became what it is [ns]."""
        self._reported: _Standing | None = None

    def look(
        self, now: int, state: tuple[State, tuple[Reason, ...]], causes: tuple[str, ...] = ()
    ) -> list[Notice]:
        """Notices at a time [ns]; state: with all its reasons; causes: known to be wrong with the inputs."""
        what, why = state
        standing = (what, why, () if is_good(what) else causes)
        if standing != self._now:
            self._now, self.since = standing, now
        if standing == self._reported or now - self.since < LASTING * SECOND:
            return []
        self._reported = standing
        text = "; ".join(
            [named(what), *(named(each) for each in why if each.name != what.name), *standing[2]]
        )
        if not is_good(what) and any(reason in _ABOUT_INPUTS for reason in why):
            text += f"; {self._arrivals.as_text(now)}"
        return [Notice(Topic.STATE, text, is_good(what))]
