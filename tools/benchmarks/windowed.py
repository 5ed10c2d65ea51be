"""The observer on what a windowed source sends: some 6 ms round each injection, the index jumps in between."""

from dataclasses import replace

import numpy as np

from observer_rt.config.bench import Bench
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.evaluation.evaluation import Evaluation
from observer_rt.desk.evaluation.trace import UNKNOWN, trace_of
from observer_rt.engine.stream.state import State
from observer_rt.files.replay.framing import Span, windows_of
from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.stream import HeldSignals


def evaluate_windowed(bench: Bench, recording: Recording) -> Evaluation:
    """The observer on a recording, from which a windowed source sends only the samples around injections.

    To the observer, recordings of one history are windows of a source: the index jumps with the needle closed, the
    E2E counters go on. Where nothing was recorded nothing is available; samples and indices are those of the whole.
    """
    spans = windows_of((recording,))
    history = evaluate(bench, [part_of(recording, span) for span in spans])
    together = Evaluation(HeldSignals(recording))
    together.first_index, together.trace = 0, trace_of(np.repeat(UNKNOWN, recording.samples))
    together.trace.state[:] = State.WAITING_FOR_DATA
    for span, part in zip(spans, history.evaluations, strict=True):
        together.trace[span.start : span.end] = part.trace
        by = span.start - part.first_index
        for result in part.injections:
            start, end = result.start_index + by, result.end_index + by
            together.injections.append(replace(result, start_index=start, end_index=end))
    return together


def part_of(recording: Recording, span: Span) -> Recording:
    parts = {name: values[span.start : span.end] for name, values in recording.signals.items()}
    return recording.with_arrays({"time": np.arange(span.end - span.start) / recording.sample_rate, **parts})
