"""The observer on what a windowed source sends: some 6 ms round each injection, the index jumps in between."""

from dataclasses import dataclass, replace

import numpy as np

from observer_rt.config.bench import Bench
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.evaluation.trace import UNKNOWN, Trace, trace_of
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.stream.state import State
from observer_rt.files.replay.framing import Span, windows_of
from observer_rt.files.signals.recording import Recording


@dataclass(frozen=True)
class WindowedEvaluation:
    """The scored part of an evaluation, on the samples of the whole recording."""

    trace: Trace
    reports: tuple[InjectionReport, ...]
    first_index: int = 0


def evaluate_windowed(bench: Bench, recording: Recording) -> WindowedEvaluation:
    """The observer on a recording, from which a windowed source sends only the samples around injections.

    To the observer, recordings of one history are windows of a source: the index jumps with the needle closed, the
    E2E counters go on. Where nothing was recorded nothing is available; samples and indices are those of the whole.
    """
    spans = windows_of((recording,))
    history = evaluate(bench, [part_of(recording, span) for span in spans])
    trace = trace_of(np.repeat(UNKNOWN, recording.samples))
    trace.state[:] = State.WAITING_FOR_DATA
    reports = []
    for span, part in zip(spans, history.evaluations, strict=True):
        trace[span.start : span.end] = part.trace
        by = span.start - part.first_index
        reports += [replace(r, start_index=r.start_index + by, end_index=r.end_index + by) for r in part.reports]
    return WindowedEvaluation(trace, tuple(reports))


def part_of(recording: Recording, span: Span) -> Recording:
    """Samples of a span, as a recording of their own."""
    parts = {name: values[span.start : span.end] for name, values in recording.signals.items()}
    return recording.with_arrays({"time": np.arange(span.end - span.start) / recording.sample_rate, **parts})
