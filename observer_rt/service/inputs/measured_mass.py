"""Masses measured online, each to the injection it belongs to."""

import math
from collections import deque
from collections.abc import Callable

from observer_rt.service.reports.injection_report import InjectionReport
from observer_rt.service.reports.news import MeasuredMass


class MassComparison:
    """Joins measured masses and reports of injections, whichever comes first.

    A value is a measurement when it is positive and is not the one before it, which a cyclic message repeats; it
    belongs to the last injection closed before it came. Of several for one injection the first counts.
    """

    def __init__(self, on_measured: Callable[[MeasuredMass], None]) -> None:
        """on_measured: called with every measured injection once it is reported too."""
        self._on_measured = on_measured
        self._value = math.nan
        self._measured = 0  # number of the last injection with a measurement
        self._waiting: deque[tuple[int, float]] = deque()
        self._report: InjectionReport | None = None

    def take(self, mass: float, closed: int) -> None:
        """Take a received value [kg, nan: not available]; closed: injections that were over when it came."""
        is_new = mass != self._value and 0.0 < mass < math.inf
        self._value = mass
        if not is_new or closed == self._measured:
            return
        self._measured = closed
        if self._report is not None and self._report.number == closed:
            self._on_measured(MeasuredMass(self._report, mass))
        else:
            self._waiting.append((closed, mass))

    def on_injection(self, report: InjectionReport) -> None:
        """Take a reported injection."""
        self._report = report
        while self._waiting and self._waiting[0][0] <= report.number:
            number, mass = self._waiting.popleft()
            if number == report.number:
                self._on_measured(MeasuredMass(report, mass))
