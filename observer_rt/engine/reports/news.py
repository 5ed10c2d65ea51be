"""News of the service: judged injections, their measured masses, missing injections, notices; and listeners."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.words import Topic
from observer_rt.foundation.units import MILLIGRAM, MILLISECOND


@dataclass(frozen=True, eq=False)
class MeasuredMass:
    """Measured mass of a reported injection [kg]."""

    report: InjectionReport
    mass: float

    @property
    def error(self) -> float:
        """Error of the estimated mass, relative; nan where none was estimated."""
        return self.report.mass / self.mass - 1.0

    def as_text(self) -> str:
        estimate = "unknown"
        if not math.isnan(self.report.mass):
            estimate = f"{self.report.mass / MILLIGRAM:.2f} mg ({100 * self.error:+.2f} %)"
        return f"injection {self.report.number}: measured {self.mass / MILLIGRAM:.2f} mg, estimate {estimate}"


@dataclass(frozen=True)
class MissingInjection:
    """An injection that is missing after a command."""

    command: int
    index: int
    window: float  # s

    def as_text(self) -> str:
        return (
            f"injection missing: the needle did not open within {self.window / MILLISECOND:g} ms of command "
            f"{self.command} at index {self.index}"
        )


@dataclass(frozen=True)
class Notice:
    """Fault of a link or an input; is_over: the end of the fault."""

    topic: Topic
    text: str
    is_over: bool = False

    def as_text(self) -> str:
        """One line and, where there is one, a remedy."""
        return self.text


News = InjectionReport | MeasuredMass | MissingInjection | Notice
"""A judged injection, whose samples are still remembered; its measured mass; one that is missing."""
Listener = Callable[[News], None]
"""Callback from the loop, for all reports and notices."""


def fan_out(listeners: Sequence[Listener]) -> Listener:
    """Listener that hands on to several, in order."""

    def tell(news: News) -> None:
        for listener in listeners:
            listener(news)

    return tell
