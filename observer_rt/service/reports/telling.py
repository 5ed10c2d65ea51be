"""News as lines of the log, records of the stream, and the service manager's status."""

from observer_rt.estimation.scalars import NOZZLE
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, ZERO_CELSIUS
from observer_rt.model.coefficients import Coefficients
from observer_rt.service.log import Voice
from observer_rt.service.notify import Notifier
from observer_rt.service.reports.deduplication import Once
from observer_rt.service.reports.injection_record import injection_record
from observer_rt.service.reports.injection_report import InjectionReport
from observer_rt.service.reports.news import MeasuredMass, Mismatch, News, Notice
from observer_rt.service.words import Topic, named


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
                self._log.say(Topic.INJECTION, line(news))
                self._log.record(injection_record(news, self._c, has_energizing=news.commanded is not None))
            case MeasuredMass():
                self._log.say(Topic.MEASURED, news.as_text())
            case Mismatch():
                self._log.say(Topic.ENERGIZING, news.as_text())
            case Notice() if not news.incident or self._once.is_new(self._log.name, news.incident):
                self._notice(news)

    def _notice(self, notice: Notice) -> None:
        """Without a name where it is the same for all injectors."""
        is_shared = notice.incident == notice.text
        text = notice.text if is_shared else self._log.named(notice.text)
        self._log.log.say(notice.topic, text, notice.is_over)
        if notice.topic in (Topic.STATE, Topic.LINK):
            self._notifier.status(text)


def line(report: InjectionReport) -> str:
    """An injection on one line."""
    verdict = "valid" if report.valid else f"not valid: {'; '.join(map(named, report.reasons))}"
    temperature = report.fuel_temperature
    fuel = "" if temperature is None else f"fuel {temperature - ZERO_CELSIUS:.1f} degC, "
    return (
        f"injection {report.number} at index {report.start_index}: {report.mass / MILLIGRAM:.2f} mg, "
        f"rail {report.rail_pressure / MEGAPASCAL:.1f} MPa, v_H {report.indicators[NOZZLE].value:+.3f}, "
        f"phi {report.phi_version}, {fuel}{verdict}"
        + (f", {report.commanded.as_text()}" if report.commanded else "")
    )
