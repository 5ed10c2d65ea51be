"""One injection as a record of names with units: of JSON documents, streams and journals."""

import math
from typing import Any

from observer_rt.estimation.scalars import SCALARS
from observer_rt.foundation.units import MEGAPASCAL, MICROSECOND, MILLIGRAM, ZERO_CELSIUS
from observer_rt.model.coefficients import Coefficients
from observer_rt.observer.learning.indicators import Estimate
from observer_rt.service.reports.injection_report import CommandedOpening, InjectionReport


def injection_record(report: InjectionReport, c: Coefficients) -> dict[str, Any]:
    """What is said of an injection; None for what is not known. c: of the nominal model."""
    temperature = report.fuel_temperature
    fuel = {} if temperature is None else {"fuel_temperature_degC": temperature - ZERO_CELSIUS}
    return {
        "number": report.number,
        "event": report.event,
        "start_index": report.start_index,
        "end_index": report.end_index,
        "rail_pressure_MPa": report.rail_pressure / MEGAPASCAL,
        "mass_mg": known(report.mass / MILLIGRAM),
        "mass_ci95_mg": report.mass_ci95 and [bound / MILLIGRAM for bound in report.mass_ci95],
        "valid": report.valid,
        "reasons": [reason.name for reason in report.reasons],
        "state": report.state.name,
        "phi_version": report.phi_version,
        **fuel,
        "indicators": {
            shown.key or shown.effect: _estimate(
                report.indicators[shown.effect], shown.factor(c), shown.unit[0]
            )
            for _, shown in SCALARS.shown()
        },
    }


def energizing_record(commanded: CommandedOpening | None) -> dict[str, Any] | None:
    """Of an injection on a bench with energizing; None for one without a command."""
    if commanded is None:
        return None
    return {
        "command": commanded.command,
        "opening_delay_us": known(commanded.opening_delay / MICROSECOND),
        "energizing_time_us": known(commanded.energizing_time / MICROSECOND),
    }


def known(value: float) -> float | None:
    """None for nan, which JSON has no word for."""
    return None if math.isnan(value) else value


def _estimate(estimate: Estimate, factor: float, unit: str) -> dict[str, Any]:
    interval = estimate.ci95
    return {
        "value": estimate.value * factor,
        "ci95": None if interval is None else [bound * factor for bound in interval],
        "unit": unit,
    }
