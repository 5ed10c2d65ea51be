"""What is said of an evaluated recording: injection by injection, as data for tables and JSON."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.evaluation.evaluate import Evaluation
from observer_rt.foundation.units import (
    MEGAPASCAL,
    MICROMETRE,
    MICROSECOND,
    MILLIGRAM,
    MM3_PER_MS,
)
from observer_rt.model.coefficients import Coefficients
from observer_rt.service.reports.injection_record import energizing_record, injection_record, known
from observer_rt.service.reports.injection_report import InjectionReport

SCHEMA = 1
PLAUSIBLE_OFFSET = 2 * MEGAPASCAL  # between line and rail pressure at standstill


@dataclass(frozen=True)
class InjectionResult:
    """One injection against the nominal model and, where measured, against the measurement (SI; nan: not known)."""

    report: InjectionReport
    start: float  # s
    end: float  # s
    nominal_mass: float  # kg
    measured_mass: float  # kg
    rate_rmse: float  # m3/s
    nominal_rate_rmse: float  # m3/s
    rate_ci95_halfwidth: float  # m3/s, of the published rate, mean while it flows


@dataclass(frozen=True)
class Check:
    """A standstill check."""

    id: str
    value: float
    unit: str
    passed: bool


def injection_results(evaluation: Evaluation) -> list[InjectionResult]:
    """Results of every injection, each over the window it was detected in."""
    online = {measured.report.number: measured.mass for measured in evaluation.measured}
    return [
        _injection_result(evaluation, report, online.get(report.number, math.nan))
        for report in evaluation.reports
    ]


def _injection_result(evaluation: Evaluation, report: InjectionReport, online_mass: float) -> InjectionResult:
    """online_mass [kg]: as measured online, nan: it was not; a measured rate goes before it."""
    recording = evaluation.recording
    first = report.start_index - evaluation.first_index
    last = min(report.end_index - evaluation.first_index, recording.samples - 1)
    window = slice(first, last + 1)
    interval = 1.0 / recording.sample_rate
    measured = recording.injection_rate[window] if recording.injection_rate is not None else None
    nominal = evaluation.trace.nominal_rate[window]
    rate = evaluation.trace.injection_rate[window]
    sigma = evaluation.trace.injection_rate_sigma[window][rate != 0.0]

    def mass(rate: NDArray[np.float64]) -> float:
        return float(np.trapezoid(rate)) * interval * report.density

    def rmse(rate: NDArray[np.float64]) -> float:
        return math.nan if measured is None else float(np.sqrt(np.mean((rate - measured) ** 2)))

    return InjectionResult(
        report=report,
        start=float(recording.time[first]),
        end=float(recording.time[last]),
        nominal_mass=mass(nominal),
        measured_mass=online_mass if measured is None else mass(measured),
        rate_rmse=rmse(rate),
        nominal_rate_rmse=rmse(nominal),
        rate_ci95_halfwidth=1.96 * float(np.mean(sigma)) if sigma.size else math.nan,
    )


def checks(evaluation: Evaluation, c: Coefficients) -> list[Check]:
    """Standstill checks: offset between line and rail pressure, noise levels."""
    standstill = evaluation.standstill
    offset = standstill.offset * c.pressure_scale
    result = [
        Check("rail_line_offset", offset / MEGAPASCAL, "MPa", abs(offset) <= PLAUSIBLE_OFFSET),
    ]
    if standstill.noise is not None:
        noise = standstill.noise
        result += [
            Check("rail_pressure_noise", noise.rail_pressure / MEGAPASCAL, "MPa", True),
            Check("line_pressure_noise", noise.line_pressure / MEGAPASCAL, "MPa", True),
            Check("needle_lift_noise", noise.needle_lift / MICROMETRE, "um", True),
        ]
    return result


def recording_json(evaluation: Evaluation, c: Coefficients) -> dict[str, Any]:
    """One recording of the JSON document."""
    results = injection_results(evaluation)
    valid = sum(result.report.valid for result in results)
    return {
        "file": str(evaluation.recording.path),
        "samples": evaluation.recording.samples,
        "sample_rate_hz": evaluation.recording.sample_rate,
        "lost_samples": evaluation.counters.lost_samples,
        "checks": [vars(check) for check in checks(evaluation, c)],
        "injections": [_injection_json(result, evaluation, c) for result in results],
        "summary": {
            "valid_share": valid / len(results) if results else 0.0,
            "adoptions": evaluation.counters.adoptions,
            "rejected_adoptions": evaluation.counters.rejected_adoptions,
            **_energizing_json(evaluation),
        },
    }


def _energizing_json(evaluation: Evaluation) -> dict[str, Any]:
    """Of the recording as a whole."""
    if not evaluation.has_energizing:
        return {}
    delays = [report.commanded.opening_delay for report in evaluation.reports if report.commanded]
    known = [delay / MICROSECOND for delay in delays if not math.isnan(delay)]
    return {
        "energizing": {
            "commands": evaluation.counters.commands,
            "missing_injections": evaluation.counters.missing_injections,
            "uncommanded_injections": evaluation.counters.uncommanded_injections,
            "mean_opening_delay_us": float(np.mean(known)) if known else None,
            "opening_delay_sigma_us": float(np.std(known)) if known else None,
        }
    }


def _injection_json(result: InjectionResult, evaluation: Evaluation, c: Coefficients) -> dict[str, Any]:
    commanded = result.report.commanded
    return {
        **injection_record(result.report, c),
        "start_s": result.start,
        "end_s": result.end,
        "nominal_mass_mg": known(result.nominal_mass / MILLIGRAM),
        "measured_mass_mg": known(result.measured_mass / MILLIGRAM),
        "rate_rmse_mm3_per_ms": known(result.rate_rmse / MM3_PER_MS),
        "nominal_rate_rmse_mm3_per_ms": known(result.nominal_rate_rmse / MM3_PER_MS),
        "rate_ci95_halfwidth_mm3_per_ms": known(result.rate_ci95_halfwidth / MM3_PER_MS),
        **({"energizing": energizing_record(commanded)} if evaluation.has_energizing else {}),
    }
