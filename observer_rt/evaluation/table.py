"""Evaluated recordings on the screen: a table of at most 80 columns and 50 rows each."""

import math
from collections.abc import Sequence

from rich.console import Console
from rich.table import Table
from rich.text import Text

from observer_rt.estimation.scalars import NOZZLE, SCALARS, SEAT
from observer_rt.evaluation.injections import InjectionResult
from observer_rt.evaluation.results import Evaluated, checks
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MM3_PER_MS
from observer_rt.model.coefficients import Coefficients
from observer_rt.observer.stream.state import Reason
from observer_rt.terminal.console import say

MOST_ROWS = 50  # injections beyond which only means of several are shown
SUMMARY_ROWS = 20
NOTEWORTHY = 4.0  # standard deviations from nothing


def print_evaluation(evaluation: Evaluated, c: Coefficients, console: Console) -> None:
    """One recording: what it is, injection by injection or, where there are many, some at a time, what is wrong."""
    counters, count = evaluation.counters, len(evaluation.injections)
    not_valid = _not_valid(evaluation.injections)
    if unfit := not_valid.get(Reason.MODEL_INADEQUATE):
        say(
            console,
            f"MODEL_INADEQUATE: the measured line pressure contradicts the model in {len(unfit)} of {count} "
            "injections; their rates and masses are not to be believed\n  remedy: check units and injector file; "
            "`observer-rt fit` calibrates it to recordings of the healthy injector",
        )
    if late := not_valid.get(Reason.LIFT_SENSOR_LAG):
        say(
            console,
            f"LIFT_SENSOR_LAG: a needle lift recorded late would explain {len(late)} of {count} injections; their "
            "rates and masses are not to be believed\n  remedy: state lag_us or filter_delay_us of "
            "[signals.needle_lift] in the bench file; `observer-rt discover` names its size",
        )
    say(
        console,
        f"{evaluation.path}: {evaluation.samples} samples at {evaluation.sample_rate:g} Hz, "
        f"{counters.lost_samples} lost; {counters.adoptions} phi adopted, {counters.rejected_adoptions} rejected",
    )
    if counters.outliers:
        say(console, counters.outliers)
    if count > MOST_ROWS:
        console.print(summary_table(evaluation.injections, evaluation.has_rate))
    elif count:
        injections = list(evaluation.injections)
        measured = any(not math.isnan(result.measured_mass) for result in injections)
        console.print(_table(injections, measured or evaluation.has_rate))
    else:
        say(console, "no injection found")
    if evaluation.has_energizing:
        say(
            console,
            f"{counters.commands} commands, {counters.missing_injections} injections missing, "
            f"{counters.uncommanded_injections} without a command",
        )
    for reason, numbers in not_valid.items():
        say(console, f"not valid for {reason.name}: {_ranges(numbers)}")
    if count:
        for line in _line_side(evaluation.injections[-1], c):
            say(console, line)
    for check in checks(evaluation, c):
        if not check.passed:
            say(console, f"check failed: {check.id} is {check.value:.3g} {check.unit}")


def _table(injections: Sequence[InjectionResult], measured: bool) -> Table:
    """Beside a measurement its error stands where otherwise the interval does: both do not fit."""
    table = Table(box=None, padding=(0, 1, 0, 0), pad_edge=False)
    headings = ["\nno", "\nevent", "start\ns", "rail\nMPa", "mass\nmg"]
    if measured:
        headings += ["nominal\nmg", "measured\nmg", "error\n%", "RMSE\nmm3/ms"]
    else:
        headings += ["95 %\nmg", "nominal\nmg"]
    for heading in [*headings, "v_H\n-", "v_S\n-", "\nvalid"]:
        table.add_column(Text(heading), justify="right", no_wrap=True)
    for result in injections:
        report = result.report
        nominal = _number(result.nominal_mass / MILLIGRAM)
        comparison = [
            _number(result.measured_mass / MILLIGRAM),
            _number(100 * (report.mass / result.measured_mass - 1)) if result.measured_mass else "-",
            _number(result.rate_rmse / MM3_PER_MS),
        ]
        table.add_row(
            str(report.number),
            str(report.event),
            f"{result.start:.3f}",
            f"{report.rail_pressure / MEGAPASCAL:.1f}",
            _number(report.mass / MILLIGRAM),
            *([nominal, *comparison] if measured else [_range(report.mass_ci95), nominal]),
            f"{report.indicators[NOZZLE].value:+.3f}",
            f"{report.indicators[SEAT].value:+.3f}",
            "yes" if report.valid else "no",
        )
    return table


def summary_table(injections: Sequence[InjectionResult], measured: bool) -> Table:
    """Means of runs of injections, in order; of masses their standard deviation, too."""
    table = Table(box=None, padding=(0, 1, 0, 0), pad_edge=False)
    headings = ["\nno", "start\ns", "rail\nMPa", "mass\nmg", "+-\nmg", "nominal\nmg"]
    headings += ["measured\nmg"] if measured else []
    for heading in [*headings, "v_H\n-", "v_S\n-", "\nvalid"]:
        table.add_column(Text(heading), justify="right", no_wrap=True)
    size = -(-len(injections) // SUMMARY_ROWS)
    for first in range(0, len(injections), size):
        run = injections[first : first + size]
        reports = [result.report for result in run]
        masses = [report.mass / MILLIGRAM for report in reports]
        table.add_row(
            f"{reports[0].number}-{reports[-1].number}" if len(run) > 1 else str(reports[0].number),
            f"{run[0].start:.3f}",
            f"{_mean([report.rail_pressure / MEGAPASCAL for report in reports]):.1f}",
            _number(_mean(masses)),
            _number(_mean([(mass - _mean(masses)) ** 2 for mass in masses]) ** 0.5),
            _number(_mean([result.nominal_mass / MILLIGRAM for result in run])),
            *([_number(_mean([result.measured_mass / MILLIGRAM for result in run]))] if measured else []),
            f"{_mean([report.indicators[NOZZLE].value for report in reports]):+.3f}",
            f"{_mean([report.indicators[SEAT].value for report in reports]):+.3f}",
            f"{100 * sum(report.valid for report in reports) / len(run):.0f} %",
        )
    return table


def _mean(values: Sequence[float]) -> float:
    """Of those that are known; nan of none."""
    known = [value for value in values if not math.isnan(value)]
    return sum(known) / len(known) if known else math.nan


def _not_valid(injections: Sequence[InjectionResult]) -> dict[Reason, list[int]]:
    """Numbers of the injections that are not valid, by reason."""
    numbers: dict[Reason, list[int]] = {}
    for result in injections:
        if not result.report.valid:
            numbers.setdefault(result.report.reason, []).append(result.report.number)
    return numbers


def _ranges(numbers: Sequence[int]) -> str:
    """Ascending numbers as "1, 4-6"."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs)


def _range(interval: tuple[float, float] | None) -> str:
    return "-" if interval is None else "-".join(f"{bound / MILLIGRAM:.1f}" for bound in interval)


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.2f}"


def _line_side(last: InjectionResult, c: Coefficients) -> list[str]:
    """What was found beside the nozzle and the seat at the last injection, none of it part of the rate."""
    found = last.report.indicators
    result = []
    for _, shown in SCALARS.shown():
        estimate, unit = found[shown.effect], shown.screen_unit or shown.unit
        if shown.label and estimate.sigma and abs(estimate.value) > NOTEWORTHY * estimate.sigma:
            factor = shown.factor(c, unit)
            value, halfwidth = estimate.value * factor, 1.96 * estimate.sigma * factor
            result.append(f"beside the rate: {shown.label} = {value:+.3g} ± {halfwidth:.2g} {unit[0]}")
    return result
