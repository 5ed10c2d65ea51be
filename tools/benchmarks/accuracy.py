"""`tools/bench accuracy`: cases of faults on independent plants, our observer and an unscented filter beside it."""

import itertools
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Annotated, Any

import pandas as pd
import typer

from observer_rt.config.bench import load_injector
from tests.observed_plants import bench_at
from tests.plants.plant import record
from tests.plants.real import WHOLE, Setting
from tests.plants.windows import windows_of
from tools.benchmarks import campaign, needles, real_injectors, scoring, worn_lines
from tools.benchmarks import command_line as cli
from tools.benchmarks.campaign import Bar, How, Row, chance_of_95, conclude, run_cases, table, values_of
from tools.benchmarks.cases import CLASSES, Group, make_case
from tools.benchmarks.discovery.discrepancies import Discrepancy
from tools.benchmarks.scoring import LIVE, OBSERVER, estimate_of, score_outcome
from tools.benchmarks.unscented import unscented_rate

CASES = 60  # per class
PEER = "peer"
PEER_KINDS = ("orifice_area", "seat_area", "orifice_and_seat_area", "line_friction", "healthy")  # of its states
ERRORS, RMSE = "observer_errors_pct", "observer_rmse"
_MAIN, _WELL = "group == 'main'", "group in ['main', 'operation']"
_WORN = "class_name == 'orifice_area' and abs(nozzle_wear) >= 0.1"  # where the ratio of x3 counts
_EACH = "class_name"
BARS = (
    Bar("mass_error_p95_pct", ERRORS, "m95", most=0.4, of=_WELL, by=_EACH),
    Bar("mass_error_max_pct", ERRORS, "m100", most=0.6, of=_WELL, by=_EACH),
    Bar("rate_rmse_p95_mm3_per_ms", RMSE, "p95", most=0.45, of=f"{_WELL} and class_name != 'chamber_pressure_rise'",
        by=_EACH),
    Bar("rate_rmse_p95_chamber_pressure", RMSE, "p95", most=0.6, of="class_name == 'chamber_pressure_rise'"),
    Bar("mass_error_p95_at_50_khz", ERRORS, "m95", most=0.7, of="class_name == 'at_50_khz'"),
    Bar("rate_rmse_p95_at_50_khz", RMSE, "p95", most=0.7, of="class_name == 'at_50_khz'"),
    Bar("mass_error_p95_at_20_khz", ERRORS, "m95", most=1.2, of="class_name == 'at_20_khz'"),
    Bar("rate_rmse_p95_at_20_khz", RMSE, "p95", most=1.2, of="class_name == 'at_20_khz'"),
    Bar("valid_share_min", "valid_share", "mean", least=0.98, of="group in ['main', 'operation', 'rate']", by=_EACH),
    Bar("wrong_valid", "wrong_valid", "sum", most=0),
    Bar("mixed_mass_error_max_pct", ERRORS, "m100", most=1.0, of="group == 'mixed'", by="label"),
    Bar("waves_valid_after_second", "valid_late", "sum", most=0, of="group == 'wave'"),
    Bar("healthy_excess_p95_pct", "excesses_pct", "p95", most=0.25, of="class_name == 'healthy'"),
    Bar("x3_mse_ratio_p5", "x3_ratio", "p5", least=40.0, of=_WORN),
    Bar("x3_mse_ratio_min", "x3_ratio", "min", of=_WORN),
    Bar("first_useful_phi_share", "in_time", "mean", least=0.97, of="not changes"),
    Bar("recovered_after_three_share", "in_time", "mean", least=1.0, of="changes"),
    Bar("worse_than_nominal_share", "much_worse", "mean", most=0.002, of="group == 'stability'", by=_EACH),
    Bar("coverage_95_share", "covered", "mean", 0.93, 0.97, of=_MAIN, from_values=300),
    Bar("coverage_95_chance_min", "covered", chance_of_95, least=campaign.CHANCE, of=_MAIN, by=_EACH),
    Bar("rate_coverage_min", "rate_coverage", "mean", least=0.90, of=_MAIN, by=_EACH),
    Bar("rate_coverage_max", "rate_coverage", "mean", most=0.98, of=_MAIN, by=_EACH),
    Bar("mass_error_over_peer", "mass_over_peer", "median", most=1.0, by=_EACH),
    Bar("rate_rmse_over_peer", "rmse_over_peer", "median", most=1.05, by=_EACH),
    Bar("rate_rmse_max_mm3_per_ms", RMSE, "max", of=_MAIN),
    Bar("mass_sum_error_max_pct", "sum_error_pct", "m100", of=_MAIN),
)  # fmt: skip
COLUMNS: dict[str, tuple[str, How]] = {
    **scoring.COLUMNS,
    "summed max": ("sum_error_pct", "m100"),
    "in time": ("in_time", "of"),
    "worse than nominal %": ("excess_pct", "max"),
    "covered": ("covered", "of"),
    "rate covered": ("rate_coverage", "mean"),
    "nominal mass %": ("nominal_errors_pct", "spread"),
    "live mass %": (f"{LIVE}_errors_pct", "spread"),
    "peer's mass %": (f"{PEER}_errors_pct", "spread"),
    "RMSE": (f"{PEER}_rmse", "spread"),
}
WORN_BARS = (
    Bar("valid_share", "valid_share", "mean", least=0.99),
    Bar("valid_share_min", "valid_share", "min", least=0.9375),
    Bar("nearer_to_nominal", "nearer_to_nominal", "sum", most=0),
    Bar("outside_own_interval", "outside_own_interval", "sum", most=0),
    Bar("wrong_valid", "wrong_valid", "sum", most=0),
    Bar("error_level_pct", ERRORS, "mean"),
    Bar("error_median_pct", ERRORS, "m50"),
    Bar("error_p95_pct", ERRORS, "m95", most=0.4),
    Bar("error_max_pct", ERRORS, "m100", most=0.8),
    Bar("coverage_95_share", "held", "mean", 0.93, 0.98),
)
WORN_COLUMNS: dict[str, tuple[str, How]] = {
    **scoring.COLUMNS,
    "worst case": ("valid_share", "min"),
    "nearer to nominal": ("nearer_to_nominal", "sum"),
    "outside own interval": ("outside_own_interval", "sum"),
    "error level %": (ERRORS, "mean"),
}


def score_case(class_name: str, seed: int, number: int, how: needles.How) -> Row:
    """Record a case, and score the observer and the peer on it; a filter wants the whole recording."""
    case = make_case(class_name, seed, number)
    observer = bench_at(case.bench.sample_rate)
    if not how.has_lift:
        return needles.score_by(how, case, observer)
    outcome, kind = record(case.bench), CLASSES[class_name]
    score = score_outcome(case, outcome, observer)
    if how.with_peer and kind.group is not Group.STABILITY and not kind.windowed:
        windows, density = windows_of(outcome, case.bench.sample_rate), case.bench.injector.density
        score.estimates[PEER] = estimate_of(unscented_rate(outcome.measured), outcome, windows, density)
    return score.facts()


def with_ratios(frame: pd.DataFrame) -> pd.DataFrame:
    if "excess_pct" in frame:
        frame["much_worse"] = frame["excess_pct"] > 1.0
    for name in PEER_KINDS:
        rows = frame[frame["class_name"].eq(name) & frame.get(f"{PEER}_rmse", pd.Series(dtype=float)).notna()]
        for ratio, column in (("mass_over_peer", "errors_pct"), ("rmse_over_peer", "rmse")):
            ours, peers = (values_of(rows, f"{each}_{column}").abs().median() for each in (OBSERVER, PEER))
            frame.loc[rows.index, ratio] = ours / peers
    return frame


@cli.app.command(
    epilog="Examples: tools/bench accuracy --cases 10 --classes orifice_area,line_friction; "
    "tools/bench accuracy --tier B; tools/bench accuracy --tier C --classes car,marine"
)
def accuracy(
    cases: Annotated[
        int | None, typer.Option(min=1, help=f"Of a class ({CASES}); B: a line ({worn_lines.CASES}); C: a kind (1).")
    ] = None,
    classes: Annotated[str, typer.Option(help="Tier A: classes, C: settings, by commas (default: all).")] = "",
    seed: cli.SeedOption = 1,
    jobs: cli.JobsOption = cli.JOBS,
    out: cli.OutOption = None,
    no_peers: Annotated[bool, typer.Option("--no-peers", help="Only our observer.")] = False,
    no_lift: cli.NoLiftOption = False,
    tier: cli.AnyTierOption = cli.AnyTier.A,
) -> None:
    """Error of mass and rate on independent plants, against the true rate, class by class."""
    out = out or Path(f"build/accuracy-{tier}{'-no-lift' * no_lift}")
    how = needles.How(not no_peers, not no_lift)
    if tier is cli.AnyTier.B:
        _on_worn_lines(cases or worn_lines.CASES, seed, jobs, out, how)
        return
    if tier is cli.AnyTier.C:
        settings = cli.chosen_names(classes, "--classes", [*Setting], [*Setting])
        _on_injectors([Setting(name) for name in settings], cases or 1, seed, jobs, out, how)
        return
    names = cli.chosen_names(classes, "--classes", CLASSES, CLASSES)
    todo = {f"{name} {seed} {n}{how}": (name, seed, n, how) for name in names for n in range(cases or CASES)}
    frame = with_ratios(run_cases("accuracy", score_case, todo, jobs, out))
    _conclude(frame, how, BARS, {"observer, from the fifth event on": table(frame, _EACH, COLUMNS)}, out)


def _conclude(
    frame: pd.DataFrame,
    how: needles.How,
    bars: Sequence[Bar],
    tables: Mapping[str, pd.DataFrame],
    out: Path,
    lines: Sequence[str] = (),
) -> None:
    """With the bars and tables, or those of needles without a lift, and the cases that are wrong while valid."""
    if not how.has_lift:
        bars = needles.BARS
        tables = {f"without a lift, by {by}": table(frame, by, needles.COLUMNS) for by in (_EACH, "needle")}
    wrong = frame[frame.get("wrong_valid", pd.Series(0, frame.index)) > 0]
    lines = [*lines, *(f"{row.label}: {row.wrong_valid:.0f} wrong while valid" for row in wrong.itertuples())]
    conclude(frame, bars, tables, out, lines)


def _on_worn_lines(cases: int, seed: int, jobs: int, out: Path, how: needles.How) -> None:
    """A plant whose fit is not adequate is left out: nothing would be valid."""
    todo: dict[str, tuple[Any, ...]] = {}
    left_out = []
    for discrepancy in Discrepancy:
        model = worn_lines.worn_model(discrepancy, seed, out)
        baseline = load_injector(model).baseline
        if baseline is None or not baseline.adequate:
            left_out.append(f"{discrepancy}: left out, its fit is INADEQUATE")
            continue
        todo |= {f"{discrepancy} {seed} {n}{how}": (discrepancy, seed, n, model, how) for n in range(cases)}
    frame = run_cases("worn-lines", worn_lines.score_worn, todo, jobs, out)
    tables = {"worn injectors on fitted lines, from the fifth event on": table(frame, _EACH, WORN_COLUMNS)}
    _conclude(frame, how, WORN_BARS, tables, out, left_out)


def _on_injectors(settings: Sequence[Setting], cases: int, seed: int, jobs: int, out: Path, how: needles.How) -> None:
    """Only whole ones with measured masses are more than healthy, or evenly worn; without a lift all have masses."""
    fits = [*itertools.product(settings, (True, False) if how.has_lift else (True,))]
    with ThreadPoolExecutor(jobs) as pool:
        models = pool.map(lambda fit: real_injectors.real_model(fit[0], seed, fit[1], out, how.has_lift), fits)
    todo = {
        f"{setting} {kind} {seed} {n}{' weighed' * weighed}{how}": (setting, kind, seed, n, weighed, model, how)
        for (setting, weighed), model in zip(fits, models, strict=True)
        for kind in (real_injectors.KINDS if weighed and setting in WHOLE else real_injectors.MAIN)
        for n in range(cases)
    }
    frame = run_cases("real-injectors", real_injectors.score_real, todo, jobs, out)
    is_weighed, is_main = frame["weighed"].eq(True), frame["kind"].isin(real_injectors.MAIN)
    tables = {
        f"realistic injectors, {which}, from the fifth event on": table(frame[rows], by, real_injectors.COLUMNS)
        for which, rows, by in (
            ("masses measured, healthy and nozzle +12 %", is_weighed & is_main, "setting"),
            ("masses measured", is_weighed, "kind"),
            ("no mass measured, healthy and nozzle +12 %", ~is_weighed, "setting"),
        )
    }
    _conclude(frame, how, real_injectors.BARS, tables, out)
