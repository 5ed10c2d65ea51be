"""Logs reports and notices in words: to the log, the stream of records and the manager."""

import math

from observer_rt.daemon.log import ServiceLog
from observer_rt.daemon.notify import Notifier
from observer_rt.engine.estimation.scalars import NOZZLE, OFFSET
from observer_rt.engine.reports.injection_report import InjectionReport, beyond_learned, injection_record
from observer_rt.engine.reports.news import MeasuredMass, Mismatch, News, Notice
from observer_rt.engine.stream.state import Reason
from observer_rt.engine.stream.validity import OF_MODEL
from observer_rt.engine.words import Topic, named
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, ZERO_CELSIUS
from observer_rt.model.effective import Coefficients


class EventLogger:
    """Listener that logs in words."""

    def __init__(self, log: ServiceLog, notifier: Notifier, c: Coefficients, name: str) -> None:
        """c: of the nominal model; name: of the injector, for records; empty: it has none."""
        self._log = log
        self._named = {"injector": name} if name else {}
        self._notifier = notifier
        self._c = c

    def hear(self, news: News) -> None:
        """Logs it."""
        match news:
            case InjectionReport():
                self._log.say(Topic.INJECTION, line(news) + self._offset(news))
                record = injection_record(news, self._c, has_energizing=news.commanded is not None)
                self._log.record(self._named | record)
            case MeasuredMass():
                self._log.say(Topic.MEASURED, news.as_text())
            case Mismatch():
                self._log.say(Topic.ENERGIZING, news.as_text())
            case Notice():
                self._log.say(news.topic, news.text, news.is_over)
                if news.topic in (Topic.STATE, Topic.LINK):
                    self._notifier.status(news.text)

    def _offset(self, report: InjectionReport) -> str:
        """Offset of the line-pressure sensor in words, where that is why."""
        if Reason.PRESSURE_OFFSET not in report.reasons or not report.indicators[OFFSET].value:
            return ""
        offset = report.indicators[OFFSET].value * self._c.pressure_scale / MEGAPASCAL
        return f", line pressure reads {offset:+.2f} MPa off"


def line(report: InjectionReport) -> str:
    """Describes an injection on one line."""
    reasons = [*map(named, report.reasons)]
    if Reason.OUTSIDE_LEARNED_RANGE in report.reasons:
        reasons.append(beyond_learned(report))
    verdict = report.validity if report.valid else f"{report.validity}: {'; '.join(reasons)}"
    if report.posterior and OF_MODEL.intersection(report.reasons):
        verdict += f" ({report.posterior_text})"
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
