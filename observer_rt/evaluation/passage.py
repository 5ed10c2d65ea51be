"""A stretch of samples while it is evaluated: what the observer said of its last samples, or of all."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from observer_rt.evaluation.trace import Signal, Trace, joined
from observer_rt.observer.stream.state import RING, State
from observer_rt.recording.signals.stream import SAMPLES_AT_ONCE
from observer_rt.service.reports.injection_report import InjectionReport
from observer_rt.service.reports.news import MeasuredMass


class Hearer(Protocol):
    """Whoever is told what becomes of a recording, in the order it becomes known."""

    def take_report(self, passage: "Passage", report: InjectionReport) -> None:
        """An injection, of which the passage still knows the samples."""

    def take_measured(self, measured: MeasuredMass) -> None:
        """The mass of the last injection, measured."""

    def take_passed(self, time: Signal, trace: Trace) -> None:
        """Samples that are now forgotten: times [s] (n,) and what was said of them."""


class Passage:
    """One stretch of a recording or a log on its way through the observer."""

    def __init__(self, hearer: Hearer, first_index: int, samples: int, rate: float, offset: int = 0) -> None:
        """first_index: that its first sample is sent with; rate [Hz]; offset: its number where nobody gives times."""
        self.hearer = hearer
        self.first_index = first_index
        self.samples = samples
        self.begin: int | None = None
        """Position of its first sample in the observer's stream; None while none came."""
        self.end = -1
        """Position after its last sample that came."""
        self.first = 0
        """Number of the first sample that is remembered."""
        self.time = np.empty(0)
        """[s], of the samples remembered."""
        self.trace = Trace.unavailable(0, State.STARTING)
        """Of these."""
        self.line_pressure = np.empty(0)
        """Of these, normalised, as the observer was given it."""
        self.measured_rate: Signal | None = None
        """Of these [m3/s], as measured."""
        self._rate, self._offset = rate, offset
        self._marks: list[
            tuple[int, int]
        ] = []  # positions in the observer's stream and samples that were there

    def give(self, time: Signal, measured_rate: Signal | None) -> None:
        """Further samples, which the observer will be given: their times [s] and measured rates [m3/s], (n,)."""
        self.time = np.concatenate((self.time, time)) if self.time.size else time
        self.trace = joined((self.trace, Trace.unavailable(time.size, State.STARTING)))
        self.line_pressure = np.concatenate((self.line_pressure, np.full(time.size, np.nan)))
        if measured_rate is not None:
            before = self.measured_rate
            self.measured_rate = measured_rate if before is None else np.concatenate((before, measured_rate))

    def pass_on(self, processed: int) -> None:
        """Hand over what lies so far back that no injection will need it. processed: samples of the observer."""
        kept = self.first
        while self._marks and self._marks[0][0] <= processed - RING:
            kept = max(kept, self._marks.pop(0)[1])
        self._hand_over(kept - self.first)

    def finish(self) -> None:
        """Nothing more will be said of it."""
        self._hand_over(self.time.size)
        while self.first < self.samples:
            self._reach(self.first + 1)
            self._hand_over(self.time.size)

    def _hand_over(self, done: int) -> None:
        if not done:
            return
        self.hearer.take_passed(self.time[:done], self.trace.part(slice(done)))
        self.first += done
        self.time = self.time[done:].copy()
        self.line_pressure = self.line_pressure[done:].copy()
        self.trace = joined((Trace.unavailable(0, State.STARTING), self.trace.part(slice(done, None))))
        if self.measured_rate is not None:
            self.measured_rate = self.measured_rate[done:].copy()

    def note(self, rows: NDArray[np.void], position: int, nominal: Signal) -> None:
        """What the observer said of some samples, the first of them at a position of its stream.

        nominal [m3/s]: what the nominal model says of them.
        """
        if self.begin is None:
            self.begin = position
        self.end = position + len(rows)
        mine, place = self._places(rows)
        rows = rows[mine]
        if place.size:
            self._marks.append((position, self.first + int(place[0])))
        trace = self.trace
        available = ~np.isnan(rows["injection_rate"])
        self.line_pressure[place] = np.where(rows["interpolated"], np.nan, rows["line_pressure"])
        trace.injection_rate[place] = rows["injection_rate"]
        trace.valid[place] = rows["valid"]
        trace.state[place] = rows["state"]
        trace.x[place[available]] = rows["x_hat"][available, :3]
        trace.phi[place[available]] = rows["phi"][available]
        trace.nominal_rate[place] = nominal[mine]

    def note_report(self, report: InjectionReport) -> None:
        """Tell an injection and how sure its rate is."""
        if report.rate_sigma is not None:
            start = report.start_index - self.first_index - self.first
            sigma = self.trace.injection_rate_sigma[max(0, start) : max(0, start + len(report.rate_sigma))]
            sigma[:] = report.rate_sigma[max(0, -start) :][: len(sigma)]
        self.hearer.take_report(self, report)

    def _places(self, rows: NDArray[np.void]) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
        """Which rows belong to it, and their places among the samples remembered."""
        place = rows["index"] - self.first_index
        mine = (place >= 0) & (place < self.samples)
        if mine.any():
            self._reach(int(place[mine].max()) + 1)
        mine &= place >= self.first
        return mine, place[mine] - self.first

    def _reach(self, samples: int) -> None:
        """Go on to a sample of a log, whose times nobody gives: those of its sample index."""
        known = self.first + self.time.size
        if known < samples:
            numbers = np.arange(known, min(self.samples, max(samples, known + SAMPLES_AT_ONCE)))
            self.give((self._offset + numbers) / self._rate, None)
