"""Evaluated recordings on the screen: a table of at most 80 columns and 50 rows each."""

import math
from collections.abc import Sequence
from statistics import fmean, pstdev

from rich.console import Console
from rich.table import Table
from rich.text import Text

from observer_rt.estimation.scalars import SCALARS
from observer_rt.evaluation.curves import RESULT_FIELDS, InjectionResult
from observer_rt.evaluation.evaluate import Evaluation
from observer_rt.evaluation.results import checks
from observer_rt.model.effective import Coefficients
from observer_rt.observer.stream.state import Reason
from observer_rt.service.reports.injection_report import WEAR, Field
from observer_rt.terminal.console import say

MOST_ROWS = 50  # injections beyond which only means of several are shown
SUMMARY_ROWS = 20
NOTEWORTHY = 4.0  # standard deviations from nothing

_NAMED = {each.name: each for each in RESULT_FIELDS}
_FIRST = [_NAMED[name] for name in ("number", "event", "start_s", "rail_pressure_MPa", "mass_mg")]
_NOMINAL, _MEASURED = _NAMED["nominal_mass_mg"], _NAMED["measured_mass_mg"]
_ERROR = Field[InjectionResult](
    "error",
    float,
    lambda r, _: 100 * (r.report.mass / r.measured_mass - 1) if r.measured_mass else None,
    "error\n%",
    ".2f",
)
_WEAR = [_NAMED[each.value.name] for each in WEAR]


def print_evaluation(evaluation: Evaluation, c: Coefficients, console: Console) -> None:
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
        console.print(_summary_table(evaluation.injections, evaluation.has_rate, c))
    elif count:
        injections = list(evaluation.injections)
        measured = any(not math.isnan(result.measured_mass) for result in injections)
        console.print(_table(injections, measured or evaluation.has_rate, c))
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


def _table(injections: Sequence[InjectionResult], measured: bool, c: Coefficients) -> Table:
    """Beside a measurement its error stands where otherwise the interval does: both do not fit."""
    compared = [_NOMINAL, _MEASURED, _ERROR, _NAMED["rate_rmse_mm3_per_ms"]]
    fields = [*_FIRST, *(compared if measured else [_NAMED["mass_ci95_mg"], _NOMINAL]), *_WEAR]
    table = _headed(*(each.heading for each in fields))
    for result in injections:
        cells = (each.text(each.of(result, c)) for each in fields)
        table.add_row(*cells, "yes" if result.report.valid else "no")
    return table


def _summary_table(injections: Sequence[InjectionResult], measured: bool, c: Coefficients) -> Table:
    """Means of runs of injections, in order; of masses their standard deviation, too."""
    number, _, start, rail, mass = _FIRST
    compared = [_NOMINAL, *([_MEASURED] if measured else []), *_WEAR]
    headings = [each.heading for each in (number, start, rail, mass, *compared)]
    table = _headed(*headings[:4], "+-\nmg", *headings[4:])
    size = -(-len(injections) // SUMMARY_ROWS)
    for first in range(0, len(injections), size):
        run = injections[first : first + size]
        numbers = [run[0].report.number, run[-1].report.number]
        rails, masses, *others = (_mean(each, run, c) for each in (rail, mass, *compared))
        known = [value for one in run if (value := mass.of(one, c)) is not None]
        table.add_row(
            "-".join(map(str, numbers[: len(run)])),
            start.text(run[0].start),
            rails,
            masses,
            mass.text(pstdev(known) if known else None),
            *others,
            f"{100 * sum(one.report.valid for one in run) / len(run):.0f} %",
        )
    return table


def _mean(field: Field[InjectionResult], run: Sequence[InjectionResult], c: Coefficients) -> str:
    """Of those that are known."""
    known = [value for one in run if (value := field.of(one, c)) is not None]
    return field.text(fmean(known) if known else None)


def _headed(*headings: str) -> Table:
    table = Table(box=None, padding=(0, 1, 0, 0), pad_edge=False)
    for heading in (*headings, "\nvalid"):
        table.add_column(Text(heading), justify="right", no_wrap=True)
    return table


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
