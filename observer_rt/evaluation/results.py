"""What is said of an evaluated recording: injection by injection, as data for tables and JSON."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from observer_rt.evaluation.injections import InjectionResult
from observer_rt.foundation.units import (
    MEGAPASCAL,
    MICROMETRE,
    MICROSECOND,
    MILLIGRAM,
    MM3_PER_MS,
)
from observer_rt.model.coefficients import Coefficients
from observer_rt.observer.stream.lift_figures import LiftFigures
from observer_rt.observer.stream.lift_zero import LIMIT
from observer_rt.observer.stream.standstill import Standstill
from observer_rt.service.core.counters import Counters
from observer_rt.service.reports.injection_record import energizing_record, injection_record, known

SCHEMA = 1
PLAUSIBLE_OFFSET = 2 * MEGAPASCAL  # between line and rail pressure at standstill


class Evaluated(Protocol):
    """What is said of an evaluated recording, in memory or not."""

    @property
    def path(self) -> Path | None:
        """Of the file."""

    @property
    def samples(self) -> int:
        """How many there are."""

    @property
    def sample_rate(self) -> float:
        """Of the recording [Hz]."""

    @property
    def has_rate(self) -> bool:
        """Whether an injection rate was measured."""

    @property
    def counters(self) -> Counters:
        """What was counted of it."""

    @property
    def standstill(self) -> Standstill:
        """Statistics of the closed needle."""

    @property
    def has_energizing(self) -> bool:
        """Whether the bench has this input."""

    @property
    def injections(self) -> Sequence[InjectionResult]:
        """In their order."""


@dataclass(frozen=True)
class Check:
    """A standstill check."""

    id: str
    value: float
    unit: str
    passed: bool


def injection_results(evaluation: Evaluated) -> list[InjectionResult]:
    """Results of every injection, each over the window it was detected in."""
    return list(evaluation.injections)


def checks(evaluation: Evaluated, c: Coefficients) -> list[Check]:
    """Standstill checks: offset between line and rail pressure, noise levels, and what the lift sensor shows."""
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
    return result + _lift_checks(standstill.lift)


def _lift_checks(lift: LiftFigures) -> list[Check]:
    result = [
        Check("needle_lift_zero", lift.zero / MICROMETRE, "um", abs(lift.zero) < LIMIT),
        Check(
            "needle_lift_crosstalk", lift.crosstalk * MEGAPASCAL / MICROMETRE, "um/MPa", lift.crosstalk == 0.0
        ),
    ]
    if not math.isnan(lift.at_stop):
        result.append(Check("needle_lift_at_stop", lift.at_stop / MICROMETRE, "um", lift.is_to_scale))
    return result


def recording_json(evaluation: Evaluated, c: Coefficients) -> dict[str, Any]:
    """One recording of the JSON document."""
    injections = [injection_json(result, evaluation.has_energizing, c) for result in evaluation.injections]
    return {**recording_json_without(evaluation, c), "injections": injections}


def recording_json_without(evaluation: Evaluated, c: Coefficients) -> dict[str, Any]:
    """The same without its injections: an empty list in their place."""
    valid = sum(result.report.valid for result in evaluation.injections)
    return {
        "file": str(evaluation.path),
        "samples": evaluation.samples,
        "sample_rate_hz": evaluation.sample_rate,
        "lost_samples": evaluation.counters.lost_samples,
        "spikes": evaluation.counters.spikes,
        "bridged_samples": evaluation.counters.bridged_samples,
        "checks": [vars(check) for check in checks(evaluation, c)],
        "injections": [],
        "summary": {
            "valid_share": valid / len(evaluation.injections) if len(evaluation.injections) else 0.0,
            "adoptions": evaluation.counters.adoptions,
            "rejected_adoptions": evaluation.counters.rejected_adoptions,
            **_energizing_json(evaluation),
        },
    }


def _energizing_json(evaluation: Evaluated) -> dict[str, Any]:
    """Of the recording as a whole."""
    if not evaluation.has_energizing:
        return {}
    delays = [
        result.report.commanded.opening_delay for result in evaluation.injections if result.report.commanded
    ]
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


def injection_json(result: InjectionResult, has_energizing: bool, c: Coefficients) -> dict[str, Any]:
    """One injection of the JSON document."""
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
        **({"energizing": energizing_record(commanded)} if has_energizing else {}),
    }
