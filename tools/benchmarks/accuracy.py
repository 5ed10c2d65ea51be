"""`tools/bench accuracy`: cases of faults on independent plants, our observer and its peers; what came out."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Table

from tests.plants.wave import Variant
from tools.benchmarks import bars, peers, worn_lines
from tools.benchmarks import command_line as cli
from tools.benchmarks.campaign import MEASURING, PACKAGE, Found, Plan, on_case
from tools.benchmarks.cases import CLASSES, LUMP_CLASSES, WAVE_CLASSES, Case, Group, make_case, on_real_line
from tools.benchmarks.discovery.real_line.discrepancies import Discrepancy
from tools.benchmarks.figures import save_figures
from tools.benchmarks.report import (
    NOTHING,
    Columns,
    Shown,
    clopper_pearson,
    crash_lines,
    known,
    mean,
    median,
    percentile,
    put_out,
    ruled,
    table_of,
)
from tools.benchmarks.score import NOMINAL, OBSERVER, CaseScore, SampleTime
from tools.benchmarks.scoring import score_case, warm_up
from tools.benchmarks.speed.sample import measure_sample_time
from tools.benchmarks.wave_recordings import fitted_model

CASES, WAVE_CASES = 60, 20  # per class
PEER_CASES = 4  # of a class of tier B: a joint UKF takes some 15 s a recording


@dataclass(frozen=True)
class Results(Found[CaseScore]):
    """missed: a line for every bar that is missed."""

    sample_time: SampleTime
    missed: tuple[str, ...]


def run_accuracy(plan: Plan) -> Results:
    """Score the cases not yet scored by this state of the code.

    The peers' results are kept apart: they stay good while only the package changes.
    """
    runs = plan.campaign
    kept = runs.store("observer", CaseScore, PACKAGE, *MEASURING)
    scores = runs.results("observer", kept, partial(on_case, make_case, score_case), plan.tasks, warm_up)
    if plan.peers:
        tasks = [task for task in plan.tasks if peers.has_peers(task.class_name)]
        work = partial(on_case, make_case, peers.score_peers)
        kept_parts = runs.store("peers", peers.PeerScore, *MEASURING)
        scores = joined(scores, runs.results("peers", kept_parts, work, tasks, warm_up))
    return _judged(runs.found(plan.tasks, scores), measure_sample_time(), bars.violations)


def run_wave_accuracy(plan: Plan, variant: Variant, given: Path | None, measured_rate: bool) -> Results:
    """The same on tier B, with a model fitted to healthy recordings, or given."""
    model, healthy = fitted_model(plan, given, variant, measured_rate)
    runs, make, ready = plan.campaign, partial(make_wave_case, variant), partial(warm_up, model)
    kept = runs.store(f"observer-{variant}", CaseScore, PACKAGE, *MEASURING, model)
    work: partial[Any] = partial(on_case, make, partial(score_case, model=model))
    scores = runs.results("observer", kept, work, plan.tasks, ready)
    if plan.peers:
        work = partial(on_case, make, partial(peers.wave_peers, peers.lumps_of(list(healthy.values()))))
        tasks = [task for task in plan.tasks if task.number < PEER_CASES]
        kept_peers = runs.store(f"peers-{variant}", peers.PeerScore, *MEASURING)
        scores = joined(scores, runs.results("peers", kept_peers, work, tasks, ready))
    return _judged(
        runs.found(plan.tasks, scores),
        measure_sample_time(model),
        partial(bars.wave_violations, variant=variant),
    )


def _judged(
    found: Found[CaseScore], took: SampleTime, violations: Callable[[Sequence[CaseScore]], Iterable[str]]
) -> Results:
    return Results(found.results, found.crashes, took, (*violations(found.results), *bars.slow_sample(took)))


def make_wave_case(variant: Variant, class_name: str, master_seed: int, number: int) -> Case:
    """The case with this number; a master seed has one injector. Raises KeyError for an unknown class."""
    case = make_case(class_name, master_seed, number)
    return replace(case, bench=on_real_line(case.bench, master_seed, variant))


def joined(scores: dict[str, CaseScore], parts: dict[str, peers.PeerScore]) -> dict[str, CaseScore]:
    """Scores by label, with those of peers that ran."""
    both = dict(scores)
    for label, part in parts.items():
        if score := scores.get(label):
            both[label] = replace(score, estimators=score.estimators + part.estimators)
    return both


def shown(results: Results) -> Iterator[Shown]:
    """The tables, then a line for every bar that is missed and every crash."""
    classes = {}
    for name, cases in bars.by_class(results.results).items():
        interval = _interval(c) if (c := bars.coverage(cases)) else NOTHING
        beside = {"x3_ratio_p5": percentile(bars.x3_ratios(cases), 5), "coverage_ci99": interval}
        classes[name] = _class_details(cases) | beside
    yield table_of("observer, from the fifth event on", "class", classes, CLASS_COLUMNS)
    if any(has_peer(score) for score in results.results):
        yield from peer_tables(results.results)
    if any(bars.followed(s) is not None for s in results.results):
        yield following_table(results.results)
    took = results.sample_time
    yield f"one sample of the observer at 100 kHz, us: needle open {took.open_us:.2f}, shut {took.closed_us:.2f}"
    yield from results.missed
    yield from crash_lines(results.crashes)


SPREAD = ("median", "p95", "max")
_MASS, _RATE = (
    f"{{[{name}][median]:.3f}} / {{[{name}][p95]:.3f}} / {{[{name}][max]:.3f}}"
    for name in ("mass_error_pct", "rate_rmse_mm3_per_ms")
)
CLASS_COLUMNS: Columns[dict[str, Any]] = {
    "cases": "{[cases]}",
    "mass error %, single valid\nmedian / p95 / max": _MASS,
    "summed\nmax": "{[mass_sum_error_pct][max]:.3f}",
    "RMSE mm3/ms\nmedian / p95 / max": _RATE,
    "valid\n%": "{[valid_share]!p:.1f}",
    "wrong\nvalid": "{[wrong_valid]}",
    # by how much more than three events of some case are, at the least
    "worse than\nnominal %": "{[sustained_excess_max_pct]:.2f}",
    "x3 ratio\np5": "{[x3_ratio_p5]:.0f}",
    "coverage %\nmass (99 % int.)": "{[coverage_95_share]!p:.0f} ({[coverage_ci99]})",
    "\nrate": "{[rate_coverage_share]!p:.1f}",
    "training ms\nmedian": "{[training_ms_median]:.1f}",
    "\np99": "{[training_ms_p99]:.1f}",
    "nominal\nmass % median": "{[peers][nominal][mass_error_pct][median]:.3f}",
}


def following_table(scores: Sequence[CaseScore]) -> Table:
    """How often the mass is within 1 % at the third event of a worn injector, and three events after a change."""
    headings = ("asked", "cases", "all", "99 % interval", "one operating point", "varying")
    table = ruled("mass within 1 % in time, share of the cases in %", ("class",), headings)

    def add(name: str, asked: str, cases: Sequence[CaseScore]) -> None:
        in_time = [bool(bars.followed(s)) for s in cases]
        kinds = [[bool(bars.followed(s)) for s in cases if s.varying is varying] for varying in (False, True)]
        shares = [f"{100.0 * np.mean(each):.1f}" if each else NOTHING for each in (in_time, *kinds)]
        table.add_row(name, asked, str(len(cases)), shares[0], _interval(in_time), *shares[1:])

    for name, cases in bars.by_class(scores).items():
        if judged := [s for s in cases if bars.followed(s) is not None]:
            add(
                name, "third event" if judged[0].change_event is None else "3 events after the change", judged
            )
    if worn := bars.worn_from_the_start(scores):
        table.add_section()
        add("wear, all classes", "third event", worn)
    return table


def _interval(found: Sequence[bool]) -> str:
    low, high = clopper_pearson(sum(found), len(found))
    return f"{100.0 * low:.0f}-{100.0 * high:.0f}"


def has_peer(score: CaseScore) -> bool:
    """Whether anything but our observer and the model beside it ran on the case."""
    return any(e.name not in (OBSERVER, NOMINAL) for e in score.estimators)


def peer_tables(scores: Sequence[CaseScore]) -> tuple[Table, Table]:
    """Every estimator, class by class, median and largest of mass error and of RMSE."""
    names = list(dict.fromkeys(e.name for s in scores for e in s.estimators))
    mass, rate = (
        ruled(f"{what}, from the fifth event on, median / max", ("class",), names, no_wrap=True)
        for what in ("mass error % of single valid injections", "RMSE mm3/ms of cases")
    )
    for class_name, members in bars.by_class(scores).items():
        if cases := [s for s in members if has_peer(s)]:
            errors = _peer_cells(names, cases, bars.mass_errors_pct)
            mass.add_row(class_name, *errors)
            rate.add_row(class_name, *_peer_cells(names, cases, rate_errors))
    return mass, rate


def rate_errors(scores: Sequence[CaseScore], name: str = OBSERVER) -> list[float]:
    """RMSE of an estimator's rate [mm3/ms], case by case."""
    return [s.rate_rmse(name) for s in scores]


def _peer_cells(
    names: Sequence[str],
    cases: Sequence[CaseScore],
    figure: Callable[[Sequence[CaseScore], str], Sequence[float]],
) -> Iterator[str]:
    """Median and largest of a figure for every estimator, over the cases it ran on."""
    for name in names:
        values = figure([s for s in cases if s.has(name)], name)
        yield f"{np.median(values):.2f} / {max(values):.2f}" if values else NOTHING


def json_document(
    scores: Sequence[CaseScore], crashes: Sequence[str], took: SampleTime, missed: Sequence[str] = ()
) -> dict[str, Any]:
    """`figures` over the classes that must be estimated well, `details` per class."""
    main = [s for s in scores if CLASSES[s.class_name].group is Group.MAIN]
    shares = [float(np.mean([s.valid_share for s in cases])) for cases in bars.by_class(main).values()]
    worn, changed = bars.worn_from_the_start(scores), [s for s in scores if s.change_event is not None]
    training = [ms for s in main for ms in s.training_ms]
    return {
        "figures": {
            "mass_error_max_pct": max(bars.mass_errors_pct(main), default=None),
            "mass_sum_error_max_pct": max(_sums(main), default=None),
            "rate_rmse_max_mm3_per_ms": max((s.rate_rmse() for s in main), default=None),
            "x3_mse_ratio_min": min(bars.x3_ratios(scores), default=None),
            "coverage_95_share": mean(bars.coverage(main)),
            "wrong_valid": sum(s.wrong_valid for s in scores),
            "valid_share_min": min(shares, default=None),
            "rate_coverage_share": mean(bars.rate_coverages(main)),
            "first_useful_phi_share": mean([bars.useful_at_third(s) for s in worn]),
            "recovered_after_three_share": mean([bars.recovered(s) for s in changed]),
            "training_ms_median": median(training),
            "training_ms_p99": percentile(training, 99),
            "sample_open_us": took.open_us,
            "sample_closed_us": took.closed_us,
        },
        "details": {
            "classes": {name: _class_details(cases) for name, cases in bars.by_class(scores).items()},
            "violations": list(missed),
            "crashes": list(crashes),
        },
    }


def _class_details(cases: Sequence[CaseScore]) -> dict[str, Any]:
    training = [ms for s in cases for ms in s.training_ms]
    covered = bars.coverage(cases)

    def errors(name: str) -> dict[str, Any]:
        masses = bars.mass_errors_pct(cases, name)
        return {"mass_error_pct": _spread(masses), "rate_rmse_mm3_per_ms": _spread(rate_errors(cases, name))}

    return {
        "cases": len(cases),
        **errors(OBSERVER),
        "mass_sum_error_pct": _spread(_sums(cases)),
        "valid_injections": sum(len(s.scored) for s in cases),
        "valid_share": mean([s.valid_share for s in cases]),
        "wrong_valid": sum(s.wrong_valid for s in cases),
        "peers": {
            e.name: errors(e.name)
            for e in cases[0].estimators
            if e.name != OBSERVER and all(s.has(e.name) for s in cases)
        },
        "sustained_excess_max_pct": max(bars.sustained_excess_pct(s) for s in cases),
        "coverage_95_share": mean(covered),
        "coverage_95_share_ci99": clopper_pearson(sum(covered), len(covered)) if covered else None,
        "rate_coverage_share": mean(bars.rate_coverages(cases)),
        "within_1_pct_in_time_share": mean(known(bars.followed(s) for s in cases)),
        "training_ms_median": median(training),
        "training_ms_p99": percentile(training, 99),
        "worst": [s.number for s in sorted(cases, key=lambda s: -s.largest_error_pct())[:3]],
    }


def _sums(scores: Sequence[CaseScore]) -> list[float]:
    """Absolute errors of the valid masses of every case that has some, summed over the case."""
    return [abs(error) for error in known(s.sum_error_pct() for s in scores)]


def _spread(values: Sequence[float]) -> dict[str, float | None]:
    return dict(zip(SPREAD, (percentile(values, share) for share in (50, 95, 100)), strict=True))


@cli.app.command(
    epilog="Examples: tools/bench accuracy --cases 10 --classes orifice_area,line_friction; "
    "tools/bench accuracy --tier B --seed 7; tools/bench accuracy --tier B --variant step --cases 3"
)
def accuracy(
    cases: Annotated[
        int | None, typer.Option(min=1, help=f"Cases per class ({CASES}; of tier B {WAVE_CASES}).")
    ] = None,
    classes: Annotated[str, typer.Option(help="Classes, by commas (default: all).")] = "",
    seed: cli.SeedOption = 1,
    workers: cli.WorkersOption = cli.PROCESSES,
    out: cli.OutOption = None,
    no_peers: cli.NoPeersOption = False,
    tier: cli.TierOption = cli.Tier.A,
    variant: Annotated[
        Variant | None,
        typer.Option(help="Tier B: all classes of faults on this line (else: wear alone, on seven lines)."),
    ] = None,
    model: cli.ModelOption = None,
    measured_rate: Annotated[
        bool,
        typer.Option(
            "--measured-rate", help="Tier B: fit with a measured rate, from an inertance 5 % wrong."
        ),
    ] = False,
    as_json: cli.JsonOption = False,
) -> None:
    """Error of mass and rate on independent plants, against the true rate, class by class."""
    default, usual, folder = LUMP_CLASSES, CASES, "accuracy"
    if tier is cli.Tier.B and not (variant or classes or model or measured_rate):
        lines = tuple(Discrepancy)
        plan = Plan(lines, cases or worn_lines.CASES, seed, workers, out or Path("build/worn-lines"), False)
        with cli.resumable("what is scored is"):
            worn = worn_lines.run_worn_lines(plan)
            put_out(as_json, worn_lines.json_document(worn), worn_lines.shown(worn))
        return
    variant = variant or Variant.PLAIN
    if tier is cli.Tier.B:
        default, usual, folder = WAVE_CLASSES, WAVE_CASES, f"accuracy-{variant}"
    chosen = cli.chosen_names(classes, "--classes", CLASSES, default)
    plan = Plan(chosen, cases or usual, seed, workers, out or Path("build") / folder, not no_peers)
    with cli.resumable("what is scored is"):
        on_waves = tier is cli.Tier.B
        found = run_wave_accuracy(plan, variant, model, measured_rate) if on_waves else run_accuracy(plan)
        cli.tell_figures(save_figures(found.results, plan.out))
        document = json_document(found.results, found.crashes, found.sample_time, found.missed)
        put_out(as_json, document, shown(found))
