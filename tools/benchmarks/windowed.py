"""A windowed source: only some 6 ms round each injection are recorded, the sample index jumps in between."""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.bench import Bench
from observer_rt.evaluation.evaluate import Trace, evaluate
from observer_rt.observer.stream.state import State
from observer_rt.recording.replay.framing import Span, windows
from observer_rt.recording.signals.recording import Recording
from observer_rt.service.core.learners import LearnerFactory
from observer_rt.service.core.messages import Counters
from observer_rt.service.reports.injection_report import InjectionReport


@dataclass(frozen=True)
class WindowedEvaluation:
    """What is scored of an evaluation, on the samples of the whole recording."""

    trace: Trace
    reports: tuple[InjectionReport, ...]
    counters: Counters
    first_index: int = 0


def evaluate_windowed(bench: Bench, recording: Recording, learner_of: LearnerFactory) -> WindowedEvaluation:
    """The observer on a recording of which a windowed source sends only what lies round the injections.

    To the observer, recordings of one history are windows of a source: the index jumps with the needle closed, the
    E2E counters go on. Where nothing was recorded nothing is available; samples and indices are those of the whole.
    """
    spans = windows(recording)
    history = evaluate(bench, [_cut(recording, span) for span in spans], learner_of=learner_of)
    first = history.evaluations[0].trace
    trace = Trace(*(_unavailable(getattr(first, each.name), recording.samples) for each in fields(Trace)))
    trace.state[:] = State.WAITING_FOR_DATA
    reports = []
    for span, part in zip(spans, history.evaluations, strict=True):
        for name, values in vars(part.trace).items():
            whole: NDArray[np.generic] = getattr(trace, name)
            whole[span.start : span.end] = values
        moved = span.start - part.first_index
        reports += [
            replace(r, start_index=r.start_index + moved, end_index=r.end_index + moved) for r in part.reports
        ]
    counted = [vars(part.counters) for part in history.evaluations]
    counters = Counters(**{name: sum(counts[name] for counts in counted) for name in counted[0]})
    return WindowedEvaluation(trace, tuple(reports), counters)


def _unavailable(like: NDArray[Any], samples: int) -> NDArray[Any]:
    """Of so many samples: nan where that is, else 0."""
    return np.full((samples, *like.shape[1:]), np.nan if like.dtype.kind == "f" else 0, like.dtype)


def _cut(recording: Recording, span: Span) -> Recording:
    part = slice(span.start, span.end)
    return Recording(
        np.arange(span.end - span.start) / recording.sample_rate,
        recording.rail_pressure[part],
        recording.needle_lift[part],
        recording.line_pressure[part],
    )
