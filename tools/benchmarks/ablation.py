"""`tools/bench accuracy --ablation`: the observer with one part changed each, so that each part earns its place."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from observer_rt.config.bench import BenchInjector
from observer_rt.estimation.scalars import SCALARS, Scalars
from observer_rt.evaluation.evaluate import evaluate
from observer_rt.observer.learning.knowledge import Knowledge, no_knowledge
from observer_rt.observer.learning.learner import Learner
from observer_rt.observer.stream.state import Constants
from observer_rt.service.compiled.constants import bench_constants, configured_noise
from observer_rt.service.core.learners import make_learner
from tools.benchmarks.batch_learning import (
    KNOWN,
    BatchResult,
    Listener,
    Model,
    Search,
    SeenEvent,
    bfgs,
    gauss_newton,
    learn_events,
    shipped_model,
    tied_rows_model,
    trained_hidden_model,
)
from tools.benchmarks.cases import Case, make_case
from tools.benchmarks.peers import paper_bench
from tools.benchmarks.plant import Outcome, record
from tools.benchmarks.report import NOTHING, Shown, mean, ruled
from tools.benchmarks.runs import BENCHMARKS, PACKAGE, Crash, Plan, Task, on_case
from tools.benchmarks.score import OBSERVER, CaseScore, score_rate, windows_of
from tools.benchmarks.scoring import (
    bench_at,
    recording_of,
    score_evaluation,
    score_outcome,
    short_case,
    timed_training,
)

CLASSES_TRIED = (
    "healthy",
    "orifice_area",
    "orifice_and_seat_area",
    "line_friction",
    "guide_leakage",
    "chamber_pressure_rise",
    "orifice_cavitation",
    "bulk_modulus",
    "line_pressure_sensor_lag",
)
SHIPPED, FREE_ROWS = "as shipped", "free rows: the paper's scheme"
_LINE_AND_SENSOR = ("offset", "friction", "leakage", "stiffness", "lag", "air")


@dataclass(frozen=True)
class VariantScore:
    """A variant on a case: what `CaseScore` says of ours. Nothing judges a batch: its validity is None."""

    name: str
    mass_error_pct: float
    rate_rmse: float
    valid_share: float | None
    wrong_valid: int | None
    training_ms: tuple[float, ...]


@dataclass(frozen=True)
class AblationScore(Task):
    """All variants on one case."""

    variants: tuple[VariantScore, ...]


def without(*names: str) -> Scalars:
    """What is learned when some of it is known beforehand.

    An offset is then what the first standstill shows.
    """
    return Scalars(
        tuple(
            replace(row, prior=KNOWN * row.prior, drift=0.0) if row.name in names else row
            for row in SCALARS.rows
        )
    )


RULES = {
    "scalars always active": Scalars(tuple(replace(row, gated_from=None) for row in SCALARS.rows)),
    "no line or sensor terms": without(*_LINE_AND_SENSOR),
    "no seat term": without("seat_bias"),
    "no network, bias only": without("nozzle_weight"),
}
BATCHES: dict[str, tuple[Callable[[float], Model], Search]] = {
    "batch: as shipped": (shipped_model, gauss_newton),
    "batch: BFGS + Armijo": (shipped_model, bfgs),
    "batch: V trained": (trained_hidden_model, gauss_newton),
    "batch: rows tied 1:12, no structure": (tied_rows_model, gauss_newton),
}
VARIANTS = (SHIPPED, *RULES, FREE_ROWS, *BATCHES)


def run_ablation(plan: Plan, console: Console) -> tuple[tuple[AblationScore, ...], tuple[Crash[Task], ...]]:
    """Score the cases not yet scored by this state of the code; progress goes to `console`."""
    runs = plan.campaign(console)
    kept = runs.store("ablation", AblationScore, PACKAGE, BENCHMARKS)
    work = partial(on_case, make_case, score_variants)
    return plan.in_order(runs.results("ablation", kept, work, plan.tasks, warm_up)), runs.crashes


def warm_up() -> None:
    """Compile, or load from the cache, what the variants use, so that no training time holds it."""
    case = short_case()
    outcome = record(case.bench)
    score_outcome(case, outcome, paper_bench(case.bench.sample_rate))
    _, events = listened(case, outcome)
    for name in BATCHES:
        _learned(name, outcome, events)


def score_variants(case: Case) -> AblationScore:
    """Record a case and score every variant on the recording."""
    outcome = record(case.bench)
    bench = bench_at(case.bench.sample_rate)
    shipped, events = listened(case, outcome)
    variants = [_of_observer(SHIPPED, shipped)]
    for name, scalars in RULES.items():

        def learner_of(
            _: BenchInjector, constants: Constants, knowledge: Knowledge, scalars: Scalars = scalars
        ) -> Learner:
            scale = constants.coefficients.pressure_scale
            return Learner(constants, no_knowledge(knowledge.noise, scale, scalars), scalars)

        variants.append(_of_observer(name, score_outcome(case, outcome, bench, learner_of)))
    variants.append(
        _of_observer(FREE_ROWS, score_outcome(case, outcome, paper_bench(case.bench.sample_rate)))
    )
    windows = windows_of(outcome, case.bench.sample_rate)
    for name in BATCHES:
        learned = _learned(name, outcome, events)
        estimator = score_rate(OBSERVER, learned.rate, outcome.truth, windows, case.bench.injector.density)
        score = replace(shipped, estimators=(estimator,))
        variants.append(
            VariantScore(name, score.mass_error_pct(), score.rate_rmse(), None, None, learned.training_ms)
        )
    return AblationScore(case.class_name, case.master_seed, case.number, tuple(variants))


def _of_observer(name: str, score: CaseScore) -> VariantScore:
    return VariantScore(
        name,
        score.mass_error_pct(),
        score.rate_rmse(),
        score.valid_share,
        score.wrong_valid,
        score.training_ms,
    )


def listened(case: Case, outcome: Outcome) -> tuple[CaseScore, tuple[SeenEvent, ...]]:
    """The observer as shipped, and the events its learner was given."""
    listeners = []

    def learner_of(fitted: BenchInjector, constants: Constants, knowledge: Knowledge) -> Listener:
        listeners.append(Listener(make_learner(fitted, constants, knowledge)))
        return listeners[-1]

    bench = bench_at(case.bench.sample_rate)
    with timed_training() as training:
        evaluation = evaluate(bench, [recording_of(outcome)], learner_of=learner_of).evaluations[0]
    lead = bench_constants(bench.injector).timing.window_lead
    openings = {r.event: r.start + lead for r in reversed(evaluation.reports)}
    heard = listeners[0].heard  # the second one is the nominal model's
    events = tuple(
        SeenEvent(window, standstill, opening - window.opening)
        for (window, standstill), (_, opening) in zip(heard, sorted(openings.items()), strict=True)
    )
    return score_evaluation(case, outcome, bench, evaluation, training), events


def _learned(name: str, outcome: Outcome, events: Sequence[SeenEvent]) -> BatchResult:
    bench = bench_at(1.0 / float(outcome.measured.time[1] - outcome.measured.time[0]))
    constants = bench_constants(bench.injector)
    model_of, search = BATCHES[name]
    model = model_of(constants.coefficients.pressure_scale)
    return learn_events(
        model, search, events, outcome.measured.time.size, constants, configured_noise(bench.injector)
    )


def ablation_tables(scores: Sequence[AblationScore]) -> tuple[Table, Table]:
    """Every variant over all cases, and class by class."""
    classes = list(dict.fromkeys(score.class_name for score in scores))
    overall = ruled(f"one part changed: {len(scores)} cases, events 11-20", ("observer",), (
        "mass error %\nmedian", "\np95", "\nmax", "RMSE mm3/ms\np95", "valid\n%", "wrong\nvalid",
        "training ms\nmedian",
    ))  # fmt: skip
    headings = [name.replace("_", "\n") for name in classes]
    by_class = ruled("mass error %, events 11-20, 95 % of the cases of a class", ("observer",), headings)
    for variant in VARIANTS:
        overall.add_row(variant, *_row(_of(variant, scores)))
        by_class.add_row(
            variant,
            *(f"{_p95_mass(_of(variant, [s for s in scores if s.class_name == c])):.3f}" for c in classes),
        )
    return overall, by_class


def ablation_shown(scores: Sequence[AblationScore], crashes: Sequence[Crash[Task]]) -> Iterator[Shown]:
    """The tables, then a line for every crash."""
    yield from ablation_tables(scores)
    yield from (f"crash: {crash.task}: {crash.message}" for crash in crashes)


def ablation_document(scores: Sequence[AblationScore], crashes: Sequence[str]) -> dict[str, Any]:
    """`figures` over all cases, `details` per variant and class."""
    classes = list(dict.fromkeys(score.class_name for score in scores))
    return {
        "figures": {"mass_error_p95_pct": {name: _p95_mass(_of(name, scores)) for name in VARIANTS}},
        "details": {
            "classes": {
                c: {name: _details(_of(name, [s for s in scores if s.class_name == c])) for name in VARIANTS}
                for c in classes
            },
            "crashes": list(crashes),
        },
    }


def _of(variant: str, scores: Sequence[AblationScore]) -> list[VariantScore]:
    return [v for score in scores for v in score.variants if v.name == variant]


def _row(found: Sequence[VariantScore]) -> list[str]:
    of = _details(found)
    is_judged = of["valid_share"] is not None
    return [
        *(f"{of['mass_error_pct'][name]:.3f}" for name in ("median", "p95", "max")),
        f"{of['rate_rmse_p95_mm3_per_ms']:.3f}",
        f"{100.0 * of['valid_share']:.1f}" if is_judged else NOTHING,
        str(of["wrong_valid"]) if is_judged else NOTHING,
        f"{of['training_ms_median']:.1f}",
    ]


def _p95_mass(found: Sequence[VariantScore]) -> float:
    return float(np.percentile([abs(v.mass_error_pct) for v in found], 95))


def _details(found: Sequence[VariantScore]) -> dict[str, Any]:
    masses = [abs(v.mass_error_pct) for v in found]
    shares = [v.valid_share for v in found if v.valid_share is not None]
    return {
        "mass_error_pct": {"median": float(np.median(masses)), "p95": _p95_mass(found), "max": max(masses)},
        "rate_rmse_p95_mm3_per_ms": float(np.percentile([v.rate_rmse for v in found], 95)),
        "valid_share": mean(shares),
        "wrong_valid": sum(v.wrong_valid or 0 for v in found) if shares else None,
        "training_ms_median": float(np.median([ms for v in found for ms in v.training_ms])),
    }
