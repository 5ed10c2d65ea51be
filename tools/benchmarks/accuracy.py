"""`tools/bench accuracy`: run the cases, print what came out."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from tools.benchmarks.bars import (
    by_class,
    coverage,
    followed,
    halfwidths,
    rate_coverages,
    recovered,
    slow_sample,
    sustained_excess_pct,
    useful_at_third,
    violations,
    worn_from_the_start,
    x3_ratios,
)
from tools.benchmarks.cases import CLASSES, Group, make_case
from tools.benchmarks.peers import PeerScore, has_paper, has_peers, score_paper, score_peers
from tools.benchmarks.report import NOTHING, Shown, clopper_pearson, mean, median, percentile, ruled
from tools.benchmarks.runs import BENCHMARKS, PACKAGE, Crash, Plan, Task, on_case
from tools.benchmarks.sample_time import measure_sample_time
from tools.benchmarks.score import NOMINAL, OBSERVER, CaseScore, SampleTime
from tools.benchmarks.scoring import score_case, warm_up


@dataclass(frozen=True)
class Results:
    """What came out; missed: a line for every bar that is missed."""

    scores: tuple[CaseScore, ...]
    crashes: tuple[Crash[Task], ...]
    sample_time: SampleTime
    missed: tuple[str, ...]


def run_accuracy(plan: Plan, console: Console) -> Results:
    """Score the cases not yet scored by this state of the code; progress goes to `console`.

    The peers' results are kept apart: they stay good while only the package changes. The paper's scheme is the
    package's, so its are not.
    """
    runs = plan.campaign(console)
    kept = runs.store("observer", CaseScore, PACKAGE, BENCHMARKS)
    scores = runs.results("observer", kept, partial(on_case, make_case, score_case), plan.tasks, warm_up)
    for name, sources, is_run, score in (
        ("peers", (BENCHMARKS,), has_peers, score_peers),
        ("paper", (PACKAGE, BENCHMARKS), has_paper, score_paper),
    ):
        if plan.peers:
            tasks = [task for task in plan.tasks if is_run(task.class_name)]
            kept_parts = runs.store(name, PeerScore, *sources)
            parts = runs.results(name, kept_parts, partial(on_case, make_case, score), tasks, warm_up)
            scores = joined(scores, parts)
    found, took = plan.in_order(scores), measure_sample_time()
    return Results(found, runs.crashes, took, (*violations(found), *slow_sample(took)))


def shown(results: Results) -> Iterator[Shown]:
    """The tables, then a line for every bar that is missed and every crash."""
    yield class_table(results.scores)
    if any(has_peer(score) for score in results.scores):
        yield from peer_tables(results.scores)
    if any(followed(s) is not None for s in results.scores):
        yield following_table(results.scores)
    took = results.sample_time
    yield f"one sample of the observer at 100 kHz, us: needle open {took.open_us:.2f}, shut {took.closed_us:.2f}"
    yield from results.missed
    yield from (f"crash: {crash.task}: {crash.message}" for crash in results.crashes)


def joined(scores: dict[str, CaseScore], parts: dict[str, PeerScore]) -> dict[str, CaseScore]:
    """Scores by label, with those of peers that ran."""
    return {
        label: with_peers(score, parts[label]) if label in parts else score for label, score in scores.items()
    }


def with_peers(score: CaseScore, part: PeerScore) -> CaseScore:
    """The score with those of peers."""
    limits = part.limits_mg or score.limits_mg
    return replace(score, estimators=score.estimators + part.estimators, limits_mg=limits)


SPREAD = ("median", "p95", "max")


def class_table(scores: Sequence[CaseScore]) -> Table:
    """Our observer, class by class.

    "worse than nominal": by how much more than three events of some case are, at the least.
    """
    table = ruled("observer, events 11-20", ("class",), (
        "cases", "mass error %\nmedian", "\np95", "\nmax", "RMSE mm3/ms\nmedian", "\np95", "\nmax",
        "valid\n%", "wrong\nvalid", "worse than\nnominal %", "x3 ratio\np5", "coverage %\nmass (99 % int.)", "\nrate",
        "training ms\nmedian", "\np99", "nominal\nmass % median",
    ))  # fmt: skip
    for name, cases in by_class(scores).items():
        table.add_row(name, *_row(cases))
    return table


def following_table(scores: Sequence[CaseScore]) -> Table:
    """How often the mass is within 1 % at the third event of a worn injector, and three events after a change."""
    headings = ("asked", "cases", "all", "99 % interval", "one operating point", "varying")
    table = ruled("mass within 1 % in time, share of the cases in %", ("class",), headings)
    for name, cases in by_class(scores).items():
        judged = [s for s in cases if followed(s) is not None]
        if judged:
            asked = "third event" if judged[0].change_event is None else "3 events after the change"
            table.add_row(name, asked, *_followed_row(judged))
    if worn := worn_from_the_start(scores):
        table.add_section()
        table.add_row("wear, all classes", "third event", *_followed_row(worn))
    return table


def _followed_row(cases: Sequence[CaseScore]) -> list[str]:
    kinds = ([s for s in cases if s.varying is varying] for varying in (False, True))
    return [
        str(len(cases)),
        _percent([bool(followed(s)) for s in cases]),
        _interval([bool(followed(s)) for s in cases]),
        *(_percent([bool(followed(s)) for s in kind]) for kind in kinds),
    ]


def _percent(found: Sequence[bool]) -> str:
    return f"{100.0 * np.mean(found):.1f}" if found else NOTHING


def _interval(found: Sequence[bool]) -> str:
    low, high = clopper_pearson(sum(found), len(found))
    return f"{100.0 * low:.0f}-{100.0 * high:.0f}"


def has_peer(score: CaseScore) -> bool:
    """Whether anything but our observer and the model beside it ran on the case, or was worked out for it."""
    return bool(score.limits_mg) or any(e.name not in (OBSERVER, NOMINAL) for e in score.estimators)


def peer_tables(scores: Sequence[CaseScore]) -> tuple[Table, Table]:
    """Every estimator, class by class, median and largest of mass error and of RMSE; and the information limit."""
    names = list(dict.fromkeys(e.name for s in scores for e in s.estimators))
    mass = ruled("mass error %, events 11-20, median / max", ("class",), names, no_wrap=True)
    rate = ruled("RMSE mm3/ms, events 11-20, median / max", ("class",), names, no_wrap=True)
    mass.add_column("limit %\n1 sigma", justify="right")
    mass.add_column("half-width\nvs limit", justify="right")
    for class_name, cases in by_class(scores).items():
        if with_peers := [s for s in cases if has_peer(s)]:
            limits = [s.limit_pct for s in with_peers if s.limit_pct is not None]
            widths = halfwidths(with_peers)
            mass.add_row(
                class_name,
                *_cells(names, with_peers, lambda s, name: abs(s.mass_error_pct(name))),
                f"{np.median(limits):.3f}" if limits else "",
                f"{np.median(widths):.2f}" if widths else "",
            )
            rate.add_row(class_name, *_cells(names, with_peers, lambda s, name: s.rate_rmse(name)))
    return mass, rate


def _cells(
    names: Sequence[str], cases: Sequence[CaseScore], figure: Callable[[CaseScore, str], float]
) -> list[str]:
    """Median and largest of a figure for every estimator, over the cases it ran on."""
    cells = []
    for name in names:
        values = [figure(s, name) for s in cases if s.has(name)]
        cells.append(f"{np.median(values):.2f} / {max(values):.2f}" if values else NOTHING)
    return cells


def _row(cases: Sequence[CaseScore]) -> list[str]:
    found, ratios = _class_details(cases), x3_ratios(cases)
    covered, rates, training = (
        found["coverage_95_share"],
        found["rate_coverage_share"],
        found["training_ms_median"],
    )
    return [
        str(found["cases"]),
        *(f"{found[name][key]:.3f}" for name in ("mass_error_pct", "rate_rmse_mm3_per_ms") for key in SPREAD),
        f"{100.0 * found['valid_share']:.1f}",
        str(found["wrong_valid"]),
        f"{found['sustained_excess_max_pct']:.2f}",
        f"{np.percentile(ratios, 5):.0f}" if ratios else NOTHING,
        "" if covered is None else f"{100.0 * covered:.0f} ({_interval(coverage(cases))})",
        "" if rates is None else f"{100.0 * rates:.1f}",
        "" if training is None else f"{training:.1f}",
        "" if training is None else f"{found['training_ms_p99']:.1f}",
        f"{np.median([abs(s.mass_error_pct(NOMINAL)) for s in cases]):.3f}",
    ]


def json_document(
    scores: Sequence[CaseScore], crashes: Sequence[str], took: SampleTime, missed: Sequence[str] = ()
) -> dict[str, Any]:
    """`figures` over the classes that must be estimated well, `details` per class."""
    main = [s for s in scores if CLASSES[s.class_name].group is Group.MAIN]
    ratios = x3_ratios(scores)
    covered = coverage(main)
    shares = [np.mean([s.valid_share for s in cases]) for cases in by_class(main).values()]
    worn, changed = worn_from_the_start(scores), [s for s in scores if s.change_event is not None]
    training = [ms for s in main for ms in s.training_ms]
    return {
        "figures": {
            "mass_error_max_pct": max((abs(s.mass_error_pct()) for s in main), default=None),
            "rate_rmse_max_mm3_per_ms": max((s.rate_rmse() for s in main), default=None),
            "x3_mse_ratio_min": min(ratios, default=None),
            "coverage_95_share": mean(covered),
            "wrong_valid": sum(s.wrong_valid for s in scores),
            "valid_share_min": float(min(shares)) if shares else None,
            "interval_halfwidth_vs_limit_median": median(halfwidths(main)),
            "rate_coverage_share": mean(rate_coverages(main)),
            "first_useful_phi_share": mean([useful_at_third(s) for s in worn]),
            "recovered_after_three_share": mean([recovered(s) for s in changed]),
            "training_ms_median": median(training),
            "training_ms_p99": percentile(training, 99),
            "sample_open_us": took.open_us,
            "sample_closed_us": took.closed_us,
        },
        "details": {
            "classes": {name: _class_details(cases) for name, cases in by_class(scores).items()},
            "violations": list(missed),
            "crashes": list(crashes),
        },
    }


def _class_details(cases: Sequence[CaseScore]) -> dict[str, Any]:
    training = [ms for s in cases for ms in s.training_ms]
    covered = coverage(cases)
    in_time = [found for s in cases if (found := followed(s)) is not None]
    return {
        "cases": len(cases),
        "mass_error_pct": _spread([abs(s.mass_error_pct()) for s in cases]),
        "rate_rmse_mm3_per_ms": _spread([s.rate_rmse() for s in cases]),
        "valid_share": float(np.mean([s.valid_share for s in cases])),
        "wrong_valid": sum(s.wrong_valid for s in cases),
        "peers": {
            e.name: {
                "mass_error_pct": _spread([abs(s.mass_error_pct(e.name)) for s in cases]),
                "rate_rmse_mm3_per_ms": _spread([s.rate_rmse(e.name) for s in cases]),
            }
            for e in cases[0].estimators
            if e.name != OBSERVER and all(s.has(e.name) for s in cases)
        },
        "sustained_excess_max_pct": max(sustained_excess_pct(s) for s in cases),
        "coverage_95_share": mean(covered),
        "coverage_95_share_ci99": clopper_pearson(sum(covered), len(covered)) if covered else None,
        "rate_coverage_share": mean(rate_coverages(cases)),
        "interval_halfwidth_vs_limit_median": median(halfwidths(cases)),
        "within_1_pct_in_time_share": mean(in_time),
        "training_ms_median": median(training),
        "training_ms_p99": percentile(training, 99),
        "worst": [s.number for s in sorted(cases, key=lambda s: -abs(s.mass_error_pct()))[:3]],
    }


def _spread(values: Sequence[float]) -> dict[str, float]:
    return dict(zip(SPREAD, (float(np.median(values)), percentile(values, 95), max(values)), strict=True))
