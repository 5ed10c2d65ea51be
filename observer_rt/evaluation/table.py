"""Evaluated recordings on the screen: a table of at most 80 columns each."""

import math
from collections.abc import Sequence

from rich.console import Console
from rich.table import Table
from rich.text import Text

from observer_rt.estimation.scalars import NOZZLE, SCALARS, SEAT
from observer_rt.evaluation.evaluate import Evaluation
from observer_rt.evaluation.results import InjectionResult, checks, injection_results
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MM3_PER_MS
from observer_rt.model.coefficients import Coefficients
from observer_rt.observer.stream.state import Reason
from observer_rt.terminal.console import say

NOTEWORTHY = 4.0  # standard deviations from nothing


def print_evaluation(evaluation: Evaluation, c: Coefficients, console: Console) -> None:
    """One recording: what it is, injection by injection, and what is wrong with it."""
    recording, counters = evaluation.recording, evaluation.counters
    injections = injection_results(evaluation)
    unfit = sum(result.report.reason is Reason.MODEL_INADEQUATE for result in injections)
    if unfit:
        say(
            console,
            f"MODEL_INADEQUATE: the measured line pressure contradicts the model in {unfit} of {len(injections)} "
            "injections; their rates and masses are not to be believed",
        )
    say(
        console,
        f"{recording.path}: {recording.samples} samples at {recording.sample_rate:g} Hz, "
        f"{counters.lost_samples} lost; {counters.adoptions} phi adopted, {counters.rejected_adoptions} rejected",
    )
    if injections:
        measured = any(not math.isnan(result.measured_mass) for result in injections)
        console.print(_table(injections, measured or recording.injection_rate is not None))
    else:
        say(console, "no injection found")
    if evaluation.has_energizing:
        say(
            console,
            f"{counters.commands} commands, {counters.missing_injections} injections missing, "
            f"{counters.uncommanded_injections} without a command",
        )
    for reason, numbers in _not_valid(injections).items():
        say(console, f"not valid for {reason.name}: {_ranges(numbers)}")
    for line in _line_side(injections, c):
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


def _line_side(injections: Sequence[InjectionResult], c: Coefficients) -> list[str]:
    """What was found beside the nozzle and the seat at the last injection, none of it part of the rate."""
    if not injections:
        return []
    found = injections[-1].report.indicators
    result = []
    for _, shown in SCALARS.shown():
        estimate, unit = found[shown.effect], shown.screen_unit or shown.unit
        if shown.label and estimate.sigma and abs(estimate.value) > NOTEWORTHY * estimate.sigma:
            factor = shown.factor(c, unit)
            value, halfwidth = estimate.value * factor, 1.96 * estimate.sigma * factor
            result.append(f"beside the rate: {shown.label} = {value:+.3g} ± {halfwidth:.2g} {unit[0]}")
    return result
