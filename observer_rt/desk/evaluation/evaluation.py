"""Evaluation of one recording or log, and the parts of it that are kept."""

from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from observer_rt.desk.evaluation.curves import InjectionResult, RateCurves, injection_result, rate_curves
from observer_rt.desk.evaluation.trace import SAMPLE, InjectionSamples, Trace, trace_arrays, trace_of
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.reports.learned_laws import LearnedLaw
from observer_rt.engine.reports.news import MeasuredMass
from observer_rt.engine.service.messages import Counters
from observer_rt.engine.stream.standstill import Standstill
from observer_rt.files.signals.stream import SignalStream
from observer_rt.files.signals.table_writers import TableWriter
from observer_rt.model.effective import Coefficients

FROZEN = 20e-3  # s in which an input stands still, beyond which it is no dropout


class Evaluation:
    """One file evaluated: its injections; its samples pass by, or are kept as a trace."""

    first_index: int
    """The sample index its first sample was sent with."""
    counters: Counters
    standstill: Standstill
    has_energizing: bool
    """Whether the bench has this input, so that reports and counters include commands."""
    learned: tuple[LearnedLaw, ...]
    """Laws of nozzle and seat as they were known at its end."""
    lift_failed = False  # and was left out, for it did not show injections that were commanded

    def __init__(self, source: SignalStream, curves_of: Coefficients | None = None, keeps_all: bool = False) -> None:
        """curves_of: nominal model, where curves are drawn; keeps_all: the trace, and all curves, not three."""
        self.path = source.path
        self.sample_rate = source.sample_rate
        self.has_rate, self.has_lift = "injection_rate" in source.optional, source.has_lift
        self.injections, self.commands = list[InjectionResult](), 0  # by the recording's own energizing
        self.curves: dict[int, RateCurves] = {}
        """Curves of injections by their number, where any are drawn."""
        self.source, self._meter = source, source.meter or ()
        self.samples = source.samples
        """Number of samples of the recording."""
        self._curves_of, self._keeps_all = curves_of, keeps_all
        self.writer: TableWriter | None = None
        """Writes the trace, where it goes to a file."""
        self._traces: list[Trace] | None = [] if keeps_all else None

    def __getstate__(self) -> dict[str, Any]:
        """A copy is a result: it holds no open file."""
        return {**vars(self), "source": None, "writer": None}

    @cached_property
    def trace(self) -> Trace:
        """Trace of all n samples, empty where it is not kept."""
        return trace_of(np.concatenate([np.empty(0, SAMPLE), *(self._traces or [])]))

    @property
    def level(self) -> str:
        """Accuracy of the level of the masses, in words; empty where the level is known."""
        return self.injections[-1].calibration.as_text() if self.injections else ""

    @property
    def has_lost_lift(self) -> bool:
        """Whether a command opened no needle, and an input froze, the lift is missing, or the line pressure fell."""
        if not self.has_lift or self.commands <= len(self.injections):
            return False
        unusable = max(self.counters.bridged_samples, self.source.survey.signals["needle_lift"].missing)
        return self.counters.unseen_injections > 0 or unusable > FROZEN * self.sample_rate

    @property
    def reports(self) -> tuple[InjectionReport, ...]:
        """Reports of all injections, without courses of rates."""
        return tuple(self.injections)

    def take_report(self, report: InjectionReport, samples: InjectionSamples) -> None:
        self.injections.append(injection_result(report, samples, self.sample_rate, self.has_rate, self._meter))
        if self._curves_of is not None:
            self.curves[report.number] = rate_curves(report, samples, self._curves_of, self.has_rate)
            if not self._keeps_all and report.number > 3:
                self.curves.pop(report.number // 2, None)  # before the middle, whatever comes

    def take_measured(self, measured: MeasuredMass) -> None:
        """Take the measured mass of the injection reported last; a measured rate goes before it."""
        last = self.injections[-1] if self.injections and not self.has_rate else None
        if last is not None and last.number == measured.report.number:
            self.injections[-1] = replace(last, measured_mass=measured.mass)

    def take_samples(self, passed: Trace) -> None:
        if self.writer is not None:
            self.writer.write(trace_arrays(passed))
        if self._traces is not None:
            self._traces.append(passed.copy())
