"""Output of an evaluated recording: a table of at most 80 columns and 50 rows, or one JSON document."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TextIO

import numpy as np
from rich.console import Console
from rich.table import Table

from observer_rt.core.stream.stream import FURTHEST_ZERO
from observer_rt.desk.evaluation.curves import RESULT_FIELDS, SHOWN, InjectionResult, in_words
from observer_rt.desk.evaluation.evaluation import Evaluation
from observer_rt.desk.injection_map.beside_map import ComparedPoint
from observer_rt.engine.estimation.parameters import NOZZLE, SCALARS, SEAT
from observer_rt.engine.reports.injection_report import FIELDS, WEAR, Field, beyond_learned, injection_record
from observer_rt.engine.reports.learned_laws import furthest
from observer_rt.engine.service.noise import SIGNALS
from observer_rt.engine.stream.state import Reason
from observer_rt.foundation.console import plain_table, say
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MICROSECOND, MILLIGRAM
from observer_rt.model.effective import Coefficients

SCHEMA = 1
PLAUSIBLE_OFFSET = 2 * MEGAPASCAL  # between line and rail pressure at standstill
MOST_ROWS = 50  # injections that are shown, the last ones
MOST_REMAINDERS = 3  # injections whose remainder is printed
NOTEWORTHY = 4.0  # standard deviations from nothing
_FIRST = [SHOWN[name] for name in ("number", "event", "start_s", "rail_pressure_MPa", "mass_mg")]
_NOMINAL, _MEASURED = SHOWN["nominal_mass_mg"], SHOWN["measured_mass_mg"]
_ERROR = Field[InjectionResult](
    "error", float, lambda r, _: 100 * (r.mass / r.measured_mass - 1) if r.measured_mass else None, "error\n%", ".2f"
)
_WEAR = [SHOWN[effect.value.name] for effect in WEAR]
_UNFIT = {
    Reason.MODEL_INADEQUATE: (
        "the measured line pressure contradicts the model in",
        "check units and injector file; `observer-rt fit` calibrates it to recordings of the healthy injector",
    ),
    Reason.LIFT_SENSOR_LAG: (
        "a needle lift recorded late would explain",
        "`observer-rt discover` tells it from a changed nozzle; if it names needle_lift_sensor_lag, state lag_us of "
        "[signals.needle_lift] in the bench file",
    ),
}
"""Problem and remedy by the reason that makes the results of many injections worthless."""
_CHANGED = (
    "the model fits the healthy injector, so that this one has changed in a way it does not know: "
    "`observer-rt discover` looks for it; or a sensor has"
)


@dataclass(frozen=True)
class Check:
    id: str
    value: float
    unit: str
    passed: bool


def checks(evaluation: Evaluation, c: Coefficients) -> list[Check]:
    """Standstill checks: offset between line and rail pressure, noise levels, and what the lift sensor shows."""
    standstill, lift = evaluation.standstill, evaluation.standstill.lift
    offset, crosstalk = standstill.offset * c.pressure_scale, lift.crosstalk * MEGAPASCAL / MICROMETRE
    result = [Check("rail_line_offset", offset / MEGAPASCAL, "MPa", abs(offset) <= PLAUSIBLE_OFFSET)]
    if (noise := standstill.noise) is not None:
        for role, (_, unit, size) in SIGNALS.items():
            result.append(Check(f"{role}_noise", getattr(noise, role.value) / size, unit, True))
    if not evaluation.has_lift:
        return result[:3]
    result += [
        Check("needle_lift_zero", lift.zero / MICROMETRE, "um", abs(lift.zero) < FURTHEST_ZERO),
        Check("needle_lift_crosstalk", crosstalk, "um/MPa", lift.crosstalk == 0.0),
    ]
    if not math.isnan(lift.at_stop):
        result.append(Check("needle_lift_at_stop", lift.at_stop / MICROMETRE, "um", lift.is_to_scale))
    return result


def write_document(
    evaluations: Sequence[Evaluation],
    model: str,
    c: Coefficients,
    out: TextIO,
    points: Sequence[ComparedPoint] | None = None,
) -> None:
    """Write one JSON document. model: SHA-256 of the parameters; c: of the nominal model; points: beside a map."""
    recordings = [_recording_json(evaluation, c) for evaluation in evaluations]
    compared = {} if points is None else {"map": [point.model_dump() for point in points]}
    json.dump({"schema": SCHEMA, "model_sha256": model, "recordings": recordings, **compared}, out, indent=2)
    out.write("\n")


def _recording_json(evaluation: Evaluation, c: Coefficients) -> dict[str, Any]:
    injections = evaluation.injections
    valid = sum(result.valid for result in injections)
    level = injections[-1].calibration if injections else None  # of all masses
    return {
        "file": str(evaluation.path),
        "samples": evaluation.samples,
        "sample_rate_hz": evaluation.sample_rate,
        "lost_samples": evaluation.counters.lost_samples,
        "spikes": evaluation.counters.spikes,
        "bridged_samples": evaluation.counters.bridged_samples,
        "checks": [vars(check) for check in checks(evaluation, c)],
        "injections": [_injection_json(result, evaluation.has_energizing, c) for result in injections],
        "summary": {
            "valid_share": valid / len(injections) if injections else 0.0,
            "adoptions": evaluation.counters.adoptions,
            "rejected_adoptions": evaluation.counters.rejected_adoptions,
            "unseen_injections": evaluation.counters.unseen_injections,
            "commands": evaluation.commands,
            "lift_failed": evaluation.lift_failed,
            **({} if level is None else {"level_ci95_pct": level.bound_pct, "calibrated": level.is_calibrated}),
            **_energizing_json(evaluation),
        },
        "learned": [law.columns for law in evaluation.learned if not law.is_surface],
        "learned_surfaces": [law.columns for law in evaluation.learned if law.is_surface],
    }


def _injection_json(result: InjectionResult, has_energizing: bool, c: Coefficients) -> dict[str, Any]:
    compared = {field.name: field.of(result, c) for field in RESULT_FIELDS[len(FIELDS) :]}
    return {**injection_record(result, c, has_energizing), **compared}


def _energizing_json(evaluation: Evaluation) -> dict[str, Any]:
    if not evaluation.has_energizing:
        return {}
    delays = [result.commanded.opening_delay for result in evaluation.injections if result.commanded]
    delays_us = [delay / MICROSECOND for delay in delays if not math.isnan(delay)]
    return {
        "energizing": {
            "commands": evaluation.counters.commands,
            "missing_injections": evaluation.counters.missing_injections,
            "mean_opening_delay_us": float(np.mean(delays_us)) if delays_us else None,
            "opening_delay_sigma_us": float(np.std(delays_us)) if delays_us else None,
        }
    }


def print_evaluation(evaluation: Evaluation, c: Coefficients, console: Console, is_fitted: bool = False) -> None:
    """Print one recording: origin, last injections, faults. is_fitted: to a healthy injector, and adequate."""
    counters, count = evaluation.counters, len(evaluation.injections)
    not_valid = _not_valid(evaluation.injections)
    for reason, (problem, remedy) in _UNFIT.items():
        if reason is Reason.MODEL_INADEQUATE and is_fitted:
            remedy = _CHANGED
        if refused := not_valid.get(reason):
            text = f"{reason.name}: {problem} {len(refused)} of {count} injections"
            say(console, f"{text}; their rates and masses are not to be believed\n  remedy: {remedy}")
    say(
        console,
        f"{evaluation.path}: {evaluation.samples} samples at {evaluation.sample_rate:g} Hz, "
        f"{counters.lost_samples} lost; {counters.adoptions} corrections adopted, "
        f"{counters.rejected_adoptions} rejected",
    )
    if counters.outliers:
        say(console, counters.outliers)
    if count:
        measured = any(not math.isnan(result.measured_mass) for result in evaluation.injections)
        console.print(_table(evaluation.injections[-MOST_ROWS:], measured or evaluation.has_rate, c))
        if count > MOST_ROWS:
            say(console, f"(the last {MOST_ROWS} of {count} injections; --json has all)")
    else:
        say(console, "no injection found")
    noted = [result for result in evaluation.injections if result.remainder_text]
    for result in sorted(noted, key=lambda result: -abs(result.remainder))[:MOST_REMAINDERS]:
        say(console, f"injection {result.number}: {result.remainder_text}")
    if evaluation.lift_failed:
        say(console, "the lift is left out, for it misses injections: the needle goes by the commands")
    if evaluation.has_energizing:
        say(console, f"{counters.commands} commands, {counters.missing_injections} injections missing")
    uncommanded = [result for result in evaluation.injections if result.reason is Reason.NO_COMMAND]
    if (idle := evaluation.commands - count + len(uncommanded)) > 0:
        say(console, f"{idle} of {evaluation.commands} commands opened no needle")
    if uncommanded:
        say(console, _of_uncommanded(uncommanded, evaluation.injections))
    elif unseen := counters.unseen_injections:
        more = f"{unseen} more that {'the lift' if evaluation.has_lift else 'the commands'} did not show"
        say(console, f"injections: {more}: the line pressure fell as by one; no row and no sum has its mass")
    for reason, numbers in not_valid.items():
        say(console, f"not valid for {reason.name}: {_ranges(numbers)}")
        if reason is Reason.OUTSIDE_LEARNED_RANGE:
            last = next(result for result in evaluation.injections if result.number == numbers[-1])
            say(console, f"({beyond_learned(last)})")
    if evaluation.level:
        say(console, evaluation.level)
    for flow in (NOZZLE, SEAT):
        if (curve := furthest(law for law in evaluation.learned if law.flow == flow)) is not None:
            say(console, curve.words)
    for law in evaluation.learned:
        if law.is_surface:
            say(console, law.words)
    if count:
        for line in _line_side(evaluation.injections[-1], c):
            say(console, line)
    for check in checks(evaluation, c):
        if not check.passed:
            say(console, f"check failed: {check.id} is {check.value:.3g} {check.unit}")


def _table(injections: Sequence[InjectionResult], measured: bool, c: Coefficients) -> Table:
    """Table of injections. Beside a measurement its error replaces the interval: both do not fit."""
    compared = [_NOMINAL, _MEASURED, _ERROR, SHOWN["rate_rmse_mm3_per_ms"]]
    fields = [*_FIRST, *(compared if measured else [SHOWN["mass_bound_mg"], _NOMINAL]), *_WEAR]
    headings = [*(field.heading for field in fields), "\nvalid"]
    rows = (
        [*(field.text(field.of(result, c)) for field in fields), "yes" if result.valid else "no"]
        for result in injections
    )
    return plain_table(headings, rows, right=range(len(headings)), folds=(), gap=1)


def _not_valid(injections: Sequence[InjectionResult]) -> dict[Reason, list[int]]:
    numbers: dict[Reason, list[int]] = {}
    for result in injections:
        if not result.valid:
            numbers.setdefault(result.reason, []).append(result.number)
    return numbers


def _of_uncommanded(rows: Sequence[InjectionResult], injections: Sequence[InjectionResult]) -> str:
    """How many injections have no command, and what part of all that was injected, in words."""
    masses, sums = ([result.mass for result in results] for results in (rows, injections))
    text = f"{len(rows)} of {len(injections)} injections without a command: by the line pressure alone "
    text += f"{np.nansum(masses) / MILLIGRAM:.2f} mg of {np.nansum(sums) / MILLIGRAM:.2f} mg in all"
    lacking = int(np.isnan(masses).sum())
    return text + (f"; {lacking} without a mass, which no sum has" if lacking else "")


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
    """Indicators beside nozzle and seat at the last injection, none of them part of the rate."""
    result = []
    for _, shown in SCALARS.shown():
        if (estimate := last.indicators.get(shown.effect)) is None:
            continue
        if shown.label and estimate.sigma and abs(estimate.value) > NOTEWORTHY * estimate.sigma:
            result.append(f"beside the rate: {in_words(shown, estimate, c)}")
    return result
