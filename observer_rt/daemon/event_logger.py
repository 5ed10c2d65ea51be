"""Logs reports and notices in words, each incident once: to the log, the stream of records and the manager."""

import math
import threading
import time

from observer_rt.daemon.log import Voice
from observer_rt.daemon.notify import Notifier
from observer_rt.engine.estimation.scalars import NOZZLE, OFFSET
from observer_rt.engine.reports.injection_report import InjectionReport, beyond_learned, injection_record
from observer_rt.engine.reports.news import MeasuredMass, Mismatch, News, Notice
from observer_rt.engine.stream.state import Reason
from observer_rt.engine.words import Topic, named
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, ZERO_CELSIUS
from observer_rt.model.effective import Coefficients

TOGETHER = 10.0  # s within which the same from another injector is the same incident


class Deduplicator:
    """Remembers the latest reports about the buses, and their sources."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._said: dict[str, tuple[float, set[str]]] = {}

    def is_new(self, who: str, what: str) -> bool:
        """Whether `who` is the first to report it, or reports it again."""
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


class EventLogger:
    """Listener that logs in words."""

    def __init__(self, log: Voice, notifier: Notifier, c: Coefficients, once: Deduplicator) -> None:
        """c: of the nominal model; once: of all injectors, for what they share."""
        self._log = log
        self._once = once
        self._notifier = notifier
        self._c = c

    def hear(self, news: News) -> None:
        """Logs it."""
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
        """Offset of the line-pressure sensor in words, where that is why."""
        if Reason.PRESSURE_OFFSET not in report.reasons or not report.indicators[OFFSET].value:
            return ""
        offset = report.indicators[OFFSET].value * self._c.pressure_scale / MEGAPASCAL
        return f", line pressure reads {offset:+.2f} MPa off"

    def _notice(self, notice: Notice) -> None:
        """Logs a notice, without a name where it is the same for all injectors."""
        is_shared = notice.incident == notice.text
        text = notice.text if is_shared else self._log.named(notice.text)
        self._log.log.say(notice.topic, text, notice.is_over)
        if notice.topic in (Topic.STATE, Topic.LINK):
            self._notifier.status(text)


def line(report: InjectionReport) -> str:
    """Describes an injection on one line."""
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
