"""Our observer, and the nominal model beside it, on one case.

Of a windowed source only some 6 ms round each injection are recorded; the sample index jumps in between.
"""

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.bench import EXAMPLE_BENCH, Bench, load_bench, load_injector
from observer_rt.config.injector import Meaning, SamplingConfig
from observer_rt.desk.evaluation.evaluate import Evaluation, Trace, evaluate
from observer_rt.desk.simulation.schedule import Schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, Simulation, simulate
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.service.judging import InlineExecutor
from observer_rt.engine.service.messages import Counters
from observer_rt.engine.stream.state import State
from observer_rt.files.replay.framing import Span, windows
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MILLISECOND
from observer_rt.model.effects import sized
from tests.observed_plants import recording_of
from tests.plants.arrays import Array
from tests.plants.plant import Outcome, record
from tests.plants.windows import Windows, windows_of
from tools.benchmarks.cases import CLASSES, Case, make_case
from tools.benchmarks.report import known
from tools.benchmarks.score import (
    NOMINAL,
    OBSERVER,
    CaseScore,
    EstimatorScore,
    Injection,
    covered_samples,
    score_rate,
)

WARM_UP_EVENTS = 3
PRESSURE_SCALE = 100 * MEGAPASCAL  # of x3
NO_REPORT = "NO_REPORT"  # in the place of a reason


@dataclass(frozen=True)
class WindowedEvaluation:
    """What is scored of an evaluation, on the samples of the whole recording."""

    trace: Trace
    reports: tuple[InjectionReport, ...]
    counters: Counters
    first_index: int = 0


def evaluate_windowed(bench: Bench, recording: Recording) -> WindowedEvaluation:
    """The observer on a recording of which a windowed source sends only what lies round the injections.

    To the observer, recordings of one history are windows of a source: the index jumps with the needle closed, the
    E2E counters go on. Where nothing was recorded nothing is available; samples and indices are those of the whole.
    """
    spans = windows(recording)
    history = evaluate(bench, [part_of(recording, span) for span in spans])
    first = history.evaluations[0].trace
    trace = Trace(
        **{
            name: np.full(
                (recording.samples, *like.shape[1:]), np.nan if like.dtype.kind == "f" else 0, like.dtype
            )
            for name, like in vars(first).items()
        }
    )
    trace.state[:] = State.WAITING_FOR_DATA
    reports = []
    for span, part in zip(spans, history.evaluations, strict=True):
        for name, values in vars(part.trace).items():
            whole: NDArray[np.generic] = getattr(trace, name)
            whole[span.start : span.end] = values
        by = span.start - part.first_index
        reports += [
            replace(r, start_index=r.start_index + by, end_index=r.end_index + by) for r in part.reports
        ]
    counted = [vars(part.counters) for part in history.evaluations]
    counters = Counters(**{name: sum(counts[name] for counts in counted) for name in counted[0]})
    return WindowedEvaluation(trace, tuple(reports), counters)


def part_of(recording: Recording, span: Span) -> Recording:
    """Samples of a span, as a recording of their own."""
    part = slice(span.start, span.end)
    return Recording(
        np.arange(span.end - span.start) / recording.sample_rate,
        recording.rail_pressure[part],
        recording.needle_lift[part],
        recording.line_pressure[part],
    )


Scored = Evaluation | WindowedEvaluation


def score_case(case: Case, model: Path | None = None) -> CaseScore:
    """Record a case and score our observer, and the model it starts from beside it, on the recording."""
    return score_outcome(case, record(case.bench), bench_for_case(case, model))


def score_outcome(case: Case, outcome: Outcome, bench: Bench) -> CaseScore:
    """Score an observer by its bench, and the nominal model beside it, on what a case came to."""
    recording = recording_of(outcome)
    with timed_training() as training:
        evaluation: Scored
        if CLASSES[case.class_name].windowed:
            evaluation = evaluate_windowed(bench, recording)
        else:
            evaluation = evaluate(bench, [recording]).evaluations[0]
    return score_evaluation(case, outcome, bench, evaluation, training)


def score_evaluation(
    case: Case, outcome: Outcome, bench: Bench, evaluation: Scored, training: Sequence[float]
) -> CaseScore:
    """Score what an observer by its bench made of a case; training: milliseconds of each event."""
    windows = windows_of(outcome, case.bench.sample_rate)
    truth, trace = outcome.truth, evaluation.trace
    density = case.bench.injector.density
    rate = np.where(np.isnan(trace.injection_rate), trace.nominal_rate, trace.injection_rate)
    nominal_x3 = x3_of_rate(trace.nominal_rate, bench)
    x3 = np.where(np.isnan(trace.x[:, 2]), nominal_x3, trace.x[:, 2])
    true_x3 = (truth.sac_pressure - case.bench.injector.chamber_pressure) / PRESSURE_SCALE
    judged, covered = covered_samples(rate - truth.injection_rate, trace.injection_rate_sigma, windows)
    injections = _injections(evaluation, windows)
    valid, reasons, intervals = _judged(evaluation, windows)

    def scored(name: str, rate: Array, x3: Array) -> EstimatorScore:
        return score_rate(name, rate, truth, windows, density, x3 - true_x3)

    return CaseScore(
        class_name=case.class_name,
        master_seed=case.master_seed,
        number=case.number,
        change_event=case.change_event,
        nozzle_wear=case.bench.events[-1].faults.orifice_area,
        varying=len({event.rail_pressure for event in case.bench.events}) > 1,
        true_mass_mg=windows.event_masses_mg(truth.injection_rate, density),
        true_opening_mass_mg=windows.opening_masses_mg(truth.injection_rate, density),
        injections=injections,
        window_samples=tuple(windows.union(e).size for e in range(len(windows.of_event))),
        estimators=(scored(OBSERVER, rate, x3), scored(NOMINAL, trace.nominal_rate, nominal_x3)),
        valid=valid,
        reasons=reasons,
        mass_ci95_mg=intervals,
        training_ms=tuple(training),
        rate_judged=judged,
        rate_covered=covered,
    )


def warm_up(model: Path | None = None) -> None:
    """Compile, or load from the cache, what a model needs, so that no case's training time holds it."""
    score_case(short_case(), model)


def short_case() -> Case:
    """A case with so few events that its score is of no interest."""
    case = make_case("orifice_area", 0, 0)
    return replace(case, bench=replace(case.bench, events=case.bench.events[:WARM_UP_EVENTS]))


def bench_for_case(case: Case, model: Path | None = None) -> Bench:
    """The example bench as a case is recorded, with another injector file than its own."""
    meaning = Meaning.MEAN if case.bench.averaged else Meaning.INSTANT
    sampling = SamplingConfig(rate_hz=case.bench.sample_rate, meaning=meaning)
    return load_bench(model=model).with_sections(sampling=sampling)


def with_signals(bench: Bench, changed: Mapping[str, Mapping[str, Any]]) -> Bench:
    """The bench with other keys of its signals, by role."""
    signals = bench.injector.config.signals
    update = {role: getattr(signals, role).model_copy(update=dict(keys)) for role, keys in changed.items()}
    return bench.with_sections(signals=signals.model_copy(update=update))


def bench_text(*changes: tuple[str, str]) -> str:
    """The example bench file with texts in the place of others."""
    text = EXAMPLE_BENCH.read_text("utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return text


def worn_injector(schedule: Schedule, sample_rate: float, wear: float = 0.2, seed: int = 1) -> Simulation:
    """What an injector with a worn nozzle [v_H] does, of the package's own simulation, with usual noise."""
    worn = (sized("orifice_area", v_H=wear),) if wear else ()
    return simulate(load_injector(), schedule, sample_rate, worn, SimulatedNoise(), seed=seed)


def x3_of_rate(rate: Array, bench: Bench) -> Array:
    """x3 at which the nominal nozzle passes a rate [m3/s]: (23) solved for p_S."""
    part = bench.injector.parameters
    jet = math.sqrt(2.0 * PRESSURE_SCALE / part.fluid.density_nozzle)
    root: Array = rate / (part.nozzle.flow_coefficient * part.nozzle.area * jet)
    return root * np.abs(root)


def _injections(evaluation: Scored, windows: Windows) -> tuple[Injection, ...]:
    """The openings of every event by the report that covers them; one without a report stands alone, not valid."""
    found = []
    for event, openings in enumerate(windows.of_event):
        reports = {i: _report_of(evaluation, windows.ranges[i]) for i in openings}
        numbers = {i: -i - 1 if report is None else report.number for i, report in reports.items()}
        for number in dict.fromkeys(numbers.values()):
            together = tuple(i for i in openings if numbers[i] == number)
            report = reports[together[0]]
            rates = [evaluation.trace.injection_rate[windows.ranges[i]] for i in together]
            missing = bool(np.isnan(np.concatenate(rates)).any())
            found.append(Injection(event, together, report is not None and report.valid and not missing))
    return tuple(found)


def _judged(
    evaluation: Scored, windows: Windows
) -> tuple[tuple[bool, ...], tuple[str, ...], tuple[tuple[float, float] | None, ...]]:
    """Validity, reasons and 95 % interval of the mass [mg] of every event, from the observer's own reports.

    An event is valid if a report belongs to each of its openings, all are valid and no rate is missing.
    """
    valid, reasons, intervals = [], [], []
    for event in range(len(windows.of_event)):
        reports = reports_of(evaluation, windows, event)
        missing = bool(np.isnan(evaluation.trace.injection_rate[windows.union(event)]).any())
        valid.append(bool(reports) and not missing and all(r.valid for r in reports))
        named = {r.reason.name for r in reports if not r.valid} if reports else {NO_REPORT}
        reasons.append(" ".join(sorted(named)))
        bounds = known(r.mass_ci95 for r in reports)
        # the openings of an event share what is uncertain, so widths add
        low, high = (sum(each[side] for each in bounds) / MILLIGRAM for side in (0, 1))
        intervals.append((low, high) if bounds and len(bounds) == len(reports) else None)
    return tuple(valid), tuple(reasons), tuple(intervals)


def reports_of(evaluation: Scored, windows: Windows, event: int) -> tuple[InjectionReport, ...]:
    """The reports of an event's openings, each once; empty when an opening has none."""
    found = [_report_of(evaluation, windows.ranges[i]) for i in windows.of_event[event]]
    reports = {report.number: report for report in found if report is not None}
    return () if None in found else tuple(reports.values())


def _report_of(evaluation: Scored, window: slice) -> InjectionReport | None:
    """The report whose window overlaps a true one most."""

    def overlap(report: InjectionReport) -> int:
        start, end = report.start_index - evaluation.first_index, report.end_index - evaluation.first_index
        return int(min(end, window.stop - 1) - max(start, window.start))

    best = max(evaluation.reports, key=overlap, default=None)
    return best if best is not None and overlap(best) > 0 else None


@contextmanager
def timed_training() -> Iterator[list[float]]:
    """Milliseconds of one core of every training run in lockstep meanwhile."""
    durations: list[float] = []
    original = InlineExecutor.submit

    def submit(self: InlineExecutor, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        begin = time.thread_time()
        future = original(self, fn, *args, **kwargs)
        durations.append((time.thread_time() - begin) / MILLISECOND)
        return future

    with patch.object(InlineExecutor, "submit", submit):
        yield durations
