"""What the service reports while it runs, once only, and to whom: log, stream of records, service manager."""

import math
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from observer_rt.estimation.scalars import NOZZLE, OFFSET
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MILLISECOND, ZERO_CELSIUS
from observer_rt.model.effective import Coefficients
from observer_rt.observer.stream.state import Reason
from observer_rt.service.log import Voice
from observer_rt.service.notify import Notifier
from observer_rt.service.reports.injection_report import InjectionReport, beyond_learned, injection_record
from observer_rt.service.words import Topic, named


@dataclass(frozen=True, eq=False)
class MeasuredMass:
    """What was measured of a reported injection [kg]."""

    report: InjectionReport
    mass: float

    @property
    def error(self) -> float:
        """Of the estimated mass, relative; nan where none was estimated."""
        return self.report.mass / self.mass - 1.0

    def as_text(self) -> str:
        """One line."""
        estimate = "unknown"
        if not math.isnan(self.report.mass):
            estimate = f"{self.report.mass / MILLIGRAM:.2f} mg ({100 * self.error:+.2f} %)"
        return f"injection {self.report.number}: measured {self.mass / MILLIGRAM:.2f} mg, estimate {estimate}"


@dataclass(frozen=True)
class Mismatch:
    """An injection that is missing after a command, or one without a command; `number` is the one's own."""

    is_missing: bool
    number: int
    index: int
    window: float  # s

    def as_text(self) -> str:
        """One line."""
        if self.is_missing:
            return (
                f"injection missing: the needle did not open within {self.window / MILLISECOND:g} ms of command "
                f"{self.number} at index {self.index}"
            )
        return f"injection {self.number} opened at index {self.index} without a command"


@dataclass(frozen=True)
class Notice:
    """Something is the matter with a link or an input, or, `is_over`, is well again.

    incident: of a bus as such, what all injectors on it call it; empty: of this injector alone.
    """

    topic: Topic
    text: str
    is_over: bool = False
    incident: str = ""

    def as_text(self) -> str:
        """One line and, where there is one, a remedy."""
        return self.text


News = InjectionReport | MeasuredMass | Mismatch | Notice
"""A judged injection, whose samples are still remembered; its measured mass; one missing or without a command."""
Listener = Callable[[News], None]
"""Is called from the loop, with all news."""


def to_all(listeners: Sequence[Listener]) -> Listener:
    """Hands on to several, in order."""

    def tell(news: News) -> None:
        for listener in listeners:
            listener(news)

    return tell


def of_bus(topic: Topic, text: str, is_over: bool = False) -> Notice:
    """A notice that is the same for all injectors on the bus."""
    return Notice(topic, text, is_over, incident=text)


class Notes:
    """A listener that keeps all it hears."""

    def __init__(self) -> None:
        self.injections: list[InjectionReport] = []
        self.measured: list[MeasuredMass] = []
        self.mismatches: list[Mismatch] = []
        self.messages: list[str] = []
        self.notices: list[Notice] = []

    def __call__(self, news: News) -> None:
        """Keep it."""
        match news:
            case InjectionReport():
                self.injections.append(news)
            case MeasuredMass():
                self.measured.append(news)
            case Mismatch():
                self.mismatches.append(news)
            case Notice(text=text):
                self.notices.append(news)
                if news.topic is Topic.LINK:
                    self.messages.append(text)


TOGETHER = 10.0  # s within which the same from another injector is the same incident


class Once:
    """Knows what was said of the buses lately, and by whom."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._said: dict[str, tuple[float, set[str]]] = {}

    def is_new(self, who: str, what: str) -> bool:
        """Whether `who` is the first to say it, or says it again."""
        now = time.monotonic()
        with self._lock:
            self._said = {
                text: (when, names) for text, (when, names) in self._said.items() if now - when < TOGETHER
            }
            _, names = self._said.get(what, (-math.inf, {who}))
            if is_new := who in names:
                names = set()
                self._said[what] = now, names
            names.add(who)
            return is_new


class Teller:
    """A listener that puts into words what it hears."""

    def __init__(self, log: Voice, notifier: Notifier, c: Coefficients, once: Once) -> None:
        """c: of the nominal model; once: of all injectors, for what they share."""
        self._log = log
        self._once = once
        self._notifier = notifier
        self._c = c

    def hear(self, news: News) -> None:
        """Say it."""
        match news:
            case InjectionReport():
                self._log.say(Topic.INJECTION, line(news) + self._offset(news))
                self._log.record(injection_record(news, self._c, has_energizing=news.commanded is not None))
            case MeasuredMass():
                self._log.say(Topic.MEASURED, news.as_text())
            case Mismatch():
                self._log.say(Topic.ENERGIZING, news.as_text())
            case Notice() if not news.incident or self._once.is_new(self._log.name, news.incident):
                self._notice(news)

    def _offset(self, report: InjectionReport) -> str:
        """How far the line-pressure sensor is off, where that is why."""
        if Reason.PRESSURE_OFFSET not in report.reasons or not report.indicators[OFFSET].value:
            return ""
        offset = report.indicators[OFFSET].value * self._c.pressure_scale / MEGAPASCAL
        return f", line pressure reads {offset:+.2f} MPa off"

    def _notice(self, notice: Notice) -> None:
        """Without a name where it is the same for all injectors."""
        is_shared = notice.incident == notice.text
        text = notice.text if is_shared else self._log.named(notice.text)
        self._log.log.say(notice.topic, text, notice.is_over)
        if notice.topic in (Topic.STATE, Topic.LINK):
            self._notifier.status(text)


def line(report: InjectionReport) -> str:
    """An injection on one line."""
    reasons = [*map(named, report.reasons)]
    if Reason.OUTSIDE_LEARNED_RANGE in report.reasons:
        reasons.append(beyond_learned(report))
    verdict = "valid" if report.valid else f"not valid: {'; '.join(reasons)}"
    temperature = report.fuel_temperature
    fuel = "" if temperature is None else f"fuel {temperature - ZERO_CELSIUS:.1f} degC, "
    mass = "mass unknown" if math.isnan(report.mass) else f"{report.mass / MILLIGRAM:.2f} mg"
    flow = 100 * report.indicators[NOZZLE].value
    return (
        f"injection {report.number} at index {report.start_index}: {mass}, "
        f"rail {report.rail_pressure / MEGAPASCAL:.1f} MPa, nozzle flow {flow:+.1f} %, "
        f"correction {report.phi_version}, {fuel}{verdict}"
        + (f", {report.commanded.as_text()}" if report.commanded else "")
    )
