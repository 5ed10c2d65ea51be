"""`tools/bench accuracy --ablation`: the observer with one part changed each, so that each part earns its place."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from rich.table import Table

from observer_rt.config.bench import BenchInjector
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.engine.estimation.scalars import SCALARS, Scalars
from observer_rt.engine.learning.knowledge import Knowledge, no_knowledge
from observer_rt.engine.learning.learner import Learner
from observer_rt.engine.service.constants import bench_constants, configured_noise
from observer_rt.engine.service.learners import make_learner
from observer_rt.engine.stream.state import Constants
from tools.benchmarks import batch_learning as batch
from tools.benchmarks.cases import Case, make_case
from tools.benchmarks.peers import paper_bench
from tools.benchmarks.plant import Outcome, record
from tools.benchmarks.report import Columns, known, mean, percentile, put_out, table_of
from tools.benchmarks.runs import BENCHMARKS, PACKAGE, Plan, Task, on_case
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
            replace(row, prior=batch.KNOWN * row.prior, drift=0.0) if row.name in names else row
            for row in SCALARS.rows
        )
    )


RULES = {
    "scalars always active": Scalars(tuple(replace(row, gated_from=None) for row in SCALARS.rows)),
    "no line or sensor terms": without(*_LINE_AND_SENSOR),
    "no seat term": without("seat_bias"),
    "no network, bias only": without("nozzle_weight"),
}
BATCHES: dict[str, tuple[Callable[[float], batch.Model], batch.Search]] = {
    "batch: as shipped": (batch.shipped_model, batch.gauss_newton),
    "batch: BFGS + Armijo": (batch.shipped_model, batch.bfgs),
    "batch: V trained": (batch.trained_hidden_model, batch.gauss_newton),
    "batch: rows tied 1:12, no structure": (batch.tied_rows_model, batch.gauss_newton),
}
VARIANTS = (SHIPPED, *RULES, FREE_ROWS, *BATCHES)


def run_ablation(plan: Plan, as_json: bool) -> None:
    """Score the cases not yet scored by this state of the code, and show what came out."""
    runs = plan.campaign
    kept = runs.store("ablation", AblationScore, PACKAGE, BENCHMARKS)
    work = partial(on_case, make_case, score_variants)
    scores = plan.in_order(runs.results("ablation", kept, work, plan.tasks, warm_up))
    document = ablation_document(scores, list(map(str, runs.crashes)))
    crashes = [f"crash: {crash.task}: {crash.message}" for crash in runs.crashes]
    put_out(as_json, document, [*ablation_tables(scores), *crashes])


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
    observers = {SHIPPED: shipped}
    for name, scalars in RULES.items():

        def learner_of(
            _: BenchInjector, constants: Constants, knowledge: Knowledge, scalars: Scalars = scalars
        ) -> Learner:
            scale = constants.coefficients.pressure_scale
            return Learner(constants, no_knowledge(knowledge.state.noise, scale, scalars), scalars)

        observers[name] = score_outcome(case, outcome, bench, learner_of)
    observers[FREE_ROWS] = score_outcome(case, outcome, paper_bench(case.bench.sample_rate))
    variants = [
        VariantScore(n, s.mass_error_pct(), s.rate_rmse(), s.valid_share, s.wrong_valid, s.training_ms)
        for n, s in observers.items()
    ]
    windows = windows_of(outcome, case.bench.sample_rate)
    for name in BATCHES:
        learned = _learned(name, outcome, events)
        estimator = score_rate(OBSERVER, learned.rate, outcome.truth, windows, case.bench.injector.density)
        score = replace(shipped, estimators=(estimator,))
        variants.append(
            VariantScore(name, score.mass_error_pct(), score.rate_rmse(), None, None, learned.training_ms)
        )
    return AblationScore(case.class_name, case.master_seed, case.number, tuple(variants))


def listened(case: Case, outcome: Outcome) -> tuple[CaseScore, tuple[batch.SeenEvent, ...]]:
    """The observer as shipped, and the events its learner was given."""
    listeners = []

    def learner_of(fitted: BenchInjector, constants: Constants, knowledge: Knowledge) -> batch.Listener:
        listeners.append(batch.Listener(make_learner(fitted, constants, knowledge)))
        return listeners[-1]

    bench = bench_at(case.bench.sample_rate)
    with timed_training() as training:
        evaluation = evaluate(bench, [recording_of(outcome)], learner_of=learner_of).evaluations[0]
    lead = bench_constants(bench.injector).timing.window_lead
    openings = {r.event: r.start + lead for r in reversed(evaluation.reports)}
    heard = listeners[0].heard  # the second one is the nominal model's
    events = tuple(
        batch.SeenEvent(window, standstill, opening - window.opening)
        for (window, standstill), (_, opening) in zip(heard, sorted(openings.items()), strict=True)
    )
    return score_evaluation(case, outcome, bench, evaluation, training), events


def _learned(name: str, outcome: Outcome, events: Sequence[batch.SeenEvent]) -> batch.BatchResult:
    bench = bench_at(1.0 / float(outcome.measured.time[1] - outcome.measured.time[0]))
    constants = bench_constants(bench.injector)
    model_of, search = BATCHES[name]
    model = model_of(constants.coefficients.pressure_scale)
    return batch.learn_events(
        model, search, events, outcome.measured.time.size, constants, configured_noise(bench.injector)
    )


_COLUMNS: Columns[dict[str, Any]] = {
    "mass error %\nmedian": "{[mass_error_pct][median]:.3f}",
    "\np95": "{[mass_error_pct][p95]:.3f}",
    "\nmax": "{[mass_error_pct][max]:.3f}",
    "RMSE mm3/ms\np95": "{[rate_rmse_p95_mm3_per_ms]:.3f}",
    "valid\n%": "{[valid_share]!p:.1f}",
    "wrong\nvalid": "{[wrong_valid]}",
    "training ms\nmedian": "{[training_ms_median]:.1f}",
}


def ablation_tables(scores: Sequence[AblationScore]) -> tuple[Table, Table]:
    """Every variant over all cases, and class by class."""
    title = f"one part changed: {len(scores)} cases, events 11-20"
    overall = table_of(title, "observer", _by_variant(scores), _COLUMNS)
    classes = {name: _by_variant(of_class) for name, of_class in _by_class(scores).items()}
    rows = {name: {c: found[name] for c, found in classes.items()} for name in VARIANTS}
    columns = {c.replace("_", "\n"): f"{{[{c}][mass_error_pct][p95]:.3f}}" for c in classes}
    return overall, table_of(
        "mass error %, events 11-20, 95 % of the cases of a class", "observer", rows, columns
    )


def ablation_document(scores: Sequence[AblationScore], crashes: Sequence[str]) -> dict[str, Any]:
    """`figures` over all cases, `details` per variant and class."""
    masses = {name: found["mass_error_pct"]["p95"] for name, found in _by_variant(scores).items()}
    classes = {name: _by_variant(of_class) for name, of_class in _by_class(scores).items()}
    return {
        "figures": {"mass_error_p95_pct": masses},
        "details": {"classes": classes, "crashes": list(crashes)},
    }


def _by_class(scores: Sequence[AblationScore]) -> dict[str, list[AblationScore]]:
    names = dict.fromkeys(score.class_name for score in scores)
    return {name: [s for s in scores if s.class_name == name] for name in names}


def _by_variant(scores: Sequence[AblationScore]) -> dict[str, dict[str, Any]]:
    """What every variant came to on these cases."""
    found = {}
    for name in VARIANTS:
        ours = [v for score in scores for v in score.variants if v.name == name]
        masses = [abs(v.mass_error_pct) for v in ours]
        shares = known(v.valid_share for v in ours)
        found[name] = {
            "mass_error_pct": {
                "median": percentile(masses, 50),
                "p95": percentile(masses, 95),
                "max": max(masses),
            },
            "rate_rmse_p95_mm3_per_ms": percentile([v.rate_rmse for v in ours], 95),
            "valid_share": mean(shares),
            "wrong_valid": sum(v.wrong_valid or 0 for v in ours) if shares else None,
            "training_ms_median": percentile([ms for v in ours for ms in v.training_ms], 50),
        }
    return found
