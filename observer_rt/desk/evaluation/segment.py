"""A stretch of samples while it is evaluated: rows of the last ones, and the trace of all as a table."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.stream.stream import RING
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.stream.state import Observer, State
from observer_rt.files.signals.stream import SAMPLES_AT_ONCE
from observer_rt.files.signals.table_writers import TABLE_WRITERS, TableWriter, WrittenColumn
from observer_rt.foundation.units import MM3_PER_MS

if TYPE_CHECKING:
    from observer_rt.desk.evaluation.evaluate import Evaluation

Signal = NDArray[np.float64]
SUFFIXES = tuple(TABLE_WRITERS)
TRACE_SUFFIX = ".trace.csv"  # added to a recording's name, in a folder
NUMBER = "%.9g"
_COLUMNS = (
    WrittenColumn("time_s", "time", "s", NUMBER),
    WrittenColumn("injection_rate_mm3_per_ms", "injection_rate", "mm3/ms", NUMBER),
    WrittenColumn("injection_rate_sigma_mm3_per_ms", "injection_rate_sigma", "mm3/ms", NUMBER),
    WrittenColumn("nominal_rate_mm3_per_ms", "nominal_rate", "mm3/ms", NUMBER),
    WrittenColumn("valid", "valid", "", "%d"),
    WrittenColumn("state", "state", "", "%s", tuple(state.name for state in State)),
    *(WrittenColumn(f"x{i}", f"x{i}", "", NUMBER) for i in (1, 2, 3)),
    *(WrittenColumn(f"phi{i}", f"phi{i}", "1/s", NUMBER) for i in (1, 2, 3)),
)
TRACE_COLUMNS = tuple(column.header for column in _COLUMNS)
"""Names of the columns of a written trace, units included."""
SAMPLE = np.dtype(
    [
        ("time", np.float64),  # s
        ("line_pressure", np.float64),  # normalised, as the observer was given it
        ("measured_rate", np.float64),  # m3/s
        ("injection_rate", np.float64),  # m3/s
        ("injection_rate_sigma", np.float64),  # m3/s, over windows of injections that were learned from
        ("nominal_rate", np.float64),  # m3/s, by the model with phi = 0 on the same frames
        ("valid", np.bool_),  # whether the rate is to be used
        ("state", np.int8),  # `State`
        ("x", np.float64, 3),  # normalised
        ("phi", np.float64, 3),  # 1/s
    ],
    align=True,
)
"""The observer at a sample of a recording; nan where not available."""
Trace: TypeAlias = np.recarray[Any, np.dtype[np.void]]
"""Samples (n,) of dtype `SAMPLE`, whose fields are attributes."""
UNKNOWN = np.array([(*[math.nan] * 6, False, int(State.STARTING), [math.nan] * 3, [math.nan] * 3)], SAMPLE)
"""A sample (1,) of which nothing is known yet."""


def trace_of(samples: NDArray[np.void]) -> Trace:
    """Trace of samples (n,) of dtype `SAMPLE`."""
    return samples.view(np.recarray)


def open_trace(path: Path) -> TableWriter:
    """A trace to be written, in the format of its suffix, one of SUFFIXES."""
    return TABLE_WRITERS[path.suffix.lower()](path, _COLUMNS)


def trace_arrays(rows: Trace) -> Sequence[NDArray[Any]]:
    """Columns of a written trace, in the order of the table, in memory of their own."""
    rates = (rows[name] / MM3_PER_MS for name in ("injection_rate", "injection_rate_sigma", "nominal_rate"))
    states = (rows[name][:, i] for name in ("x", "phi") for i in range(3))
    return [values.copy() for values in (rows.time, *rates, rows.valid, rows.state, *states)]


class Segment:
    """One stretch of a recording or a log on its way through the observer."""

    def __init__(
        self, sink: "Evaluation", first_index: int, samples: int, rate: float, offset: int = 0
    ) -> None:
        """sink: takes the results; first_index: that its first sample is sent with; samples: at least.

        rate [Hz]; offset: number of its first sample where nobody gives times.
        """
        self.sink = sink
        self.first_index = first_index
        self.samples = samples
        self.begin: int | None = None
        """Position of its first sample in the observer's stream; None while none came."""
        self.end = -1
        """Position after its last sample that came."""
        self.first = 0
        """Number of the first sample that is remembered."""
        self._rows = np.empty(0, SAMPLE)
        self._begin = self._end = 0  # of those remembered, among the rows
        self._is_measured = False
        self._rate, self._offset = rate, offset
        self._start = math.nan  # s, time of its first sample
        self._marks: list[
            tuple[int, int]
        ] = []  # positions in the observer's stream and samples that were there

    @property
    def trace(self) -> Trace:
        """Samples remembered."""
        return trace_of(self._rows[self._begin : self._end])

    @property
    def measured_rate(self) -> Signal | None:
        """Measured rate of the samples remembered [m3/s] (n,); None without one."""
        return self.trace.measured_rate if self._is_measured else None

    def give(self, time: Signal, measured_rate: Signal | None) -> None:
        """Append samples, which the observer will be given: their times [s] and measured rates [m3/s], (n,)."""
        if self.first == 0 and self._begin == self._end and time.size:
            self._start = float(time[0])
        if self._end + time.size > len(self._rows):
            self._make_room(time.size)
        end = self._end + time.size
        rows = self._rows[self._end : end]
        rows[:] = UNKNOWN
        rows["time"] = time
        if measured_rate is not None:
            self._is_measured = True
            rows["measured_rate"] = measured_rate
        self._end = end
        self.samples = max(self.samples, self.first + end - self._begin)

    def time_at(self, index: int) -> float:
        """Time [s] of the sample that was sent with an index, be it remembered or not."""
        number = index - self.first_index
        if self.first <= number < self.first + self.trace.size:
            return float(self.trace.time[number - self.first])
        return self._start + number / self._rate

    def _make_room(self, samples: int) -> None:
        """Make room for so many further samples, and seldom."""
        kept = self._rows[self._begin : self._end]
        if 2 * (len(kept) + samples) > len(self._rows):
            self._rows = np.empty(3 * (len(kept) + samples), SAMPLE)
        self._rows[: len(kept)] = kept
        self._begin, self._end = 0, len(kept)

    def pass_on(self, processed: int) -> None:
        """Hand over what lies so far back that no injection will need it. processed: samples of the observer."""
        kept = self.first
        while self._marks and self._marks[0][0] <= processed - RING:
            kept = max(kept, self._marks.pop(0)[1])
        self._hand_over(kept - self.first)

    def finish(self) -> None:
        """Hand over all samples: no further results of them will come."""
        self._hand_over(self.trace.size)
        while self.first < self.samples:
            self._reach(self.first + 1)
            self._hand_over(self.trace.size)

    def _hand_over(self, done: int) -> None:
        if done:
            self.sink.take_passed(trace_of(self._rows[self._begin : self._begin + done]))
            self.first += done
            self._begin += done

    def note(self, observer: Observer, position: int, index: NDArray[np.int64], nominal: Signal) -> None:
        """Take the observer's results of some samples, the first of them at a position of its stream.

        index (n,) of the samples, rising; nominal [m3/s] (n,): rate of the nominal model.
        """
        if self.begin is None:
            self.begin = position
        self.end = position + len(index)
        bounds = np.array([self.first, self.samples]) + self.first_index
        first, end = np.searchsorted(index, bounds).tolist()
        if first < end:
            self._reach(int(index[end - 1]) + 1 - self.first_index)
            self._marks.append((position, int(index[first]) - self.first_index))
        offset = index - (self.first_index + self.first)
        is_inside = (offset >= 0) & (offset < self.trace.size)
        self._note_samples(
            observer,
            (position + np.flatnonzero(is_inside)) % len(observer.ring),
            offset[is_inside],
            nominal[is_inside],
        )

    def _note_samples(
        self, observer: Observer, rows: NDArray[np.int64], offset: NDArray[np.int64], nominal: Signal
    ) -> None:
        """Copy some rows (k,) of the observer's ring to the places (k,) of their samples."""
        ring, trace = observer.ring, self.trace
        trace.line_pressure[offset] = np.where(
            ring["interpolated"][rows], np.nan, ring["line_pressure"][rows]
        )
        trace.nominal_rate[offset] = nominal
        for name in ("injection_rate", "valid", "state"):
            trace[name][offset] = ring[name][rows]
        is_known = ~np.isnan(ring["injection_rate"][rows])
        trace.x[offset[is_known]] = observer.x_hat[rows[is_known], :3]
        trace.phi[offset[is_known]] = ring["phi"][rows[is_known]]

    def note_report(self, report: InjectionReport) -> None:
        """Pass on the report of an injection, and note the standard deviation of its rate."""
        if report.rate_sigma is not None:
            start = report.start_index - self.first_index - self.first
            sigma = self.trace.injection_rate_sigma[max(0, start) : max(0, start + len(report.rate_sigma))]
            sigma[:] = report.rate_sigma[max(0, -start) :][: len(sigma)]
        self.sink.take_report(self, report)

    def _reach(self, samples: int) -> None:
        """Go on to a sample of a log, whose times nobody gives: those of its sample index."""
        end = self.first + self.trace.size
        if end < samples:
            numbers = np.arange(end, min(self.samples, max(samples, end + SAMPLES_AT_ONCE)))
            self.give((self._offset + numbers) / self._rate, None)
