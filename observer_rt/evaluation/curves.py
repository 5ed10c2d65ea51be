"""An injection against the nominal model and, where there is one, the measurement: figures and curves."""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.evaluation.compiled import area, mean_flowing, rms_difference
from observer_rt.evaluation.trace import Signal, Trace
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MM3_PER_MS
from observer_rt.model.effective import Coefficients
from observer_rt.service.reports.injection_report import (
    FIELDS,
    Field,
    InjectionReport,
    Output,
    injection_record,
)

CURVES = 3  # injections drawn as curves where none are chosen
MOST_CURVES = 8
OPTION = "--injections"


@dataclass(frozen=True, eq=False)
class PressureCurves:
    """Line pressure of one injection [Pa] (n,): as measured, and by the observer, open loop from the opening on."""

    measured: Signal
    modelled: Signal


@dataclass(frozen=True, eq=False)
class RateCurves:
    """Rates of one injection [m3/s] over time [s].

    reference: what it is compared with, if anything; sigma: standard deviation of the estimated rate, where known;
    line: its line pressure, where there is one.
    """

    title: str
    time: Signal
    estimated: Signal
    nominal: Signal
    reference: Signal | None
    sigma: Signal | None = None
    line: PressureCurves | None = None


def shown_numbers(injections: int) -> list[int]:
    """The first, a middle and the last one of so many."""
    return sorted({0, injections // 2, injections - 1})[:CURVES] if injections else []


def chosen_numbers(text: str) -> tuple[int, ...]:
    """Numbers of injections from `1,5-8`. Raises `UserError` for what is none, or more than can be drawn."""
    found: set[int] = set()
    for part in text.split(","):
        first, dash, last = (piece.strip() for piece in part.partition("-"))
        bounds = (first, last) if dash else (first, first)
        if not all(bound.isdecimal() and len(bound) < 10 and int(bound) > 0 for bound in bounds):
            raise UserError(
                OPTION, f"'{part.strip()}' is no number of an injection", "write it as 7, 1,5 or 1,5-8"
            )
        low, high = map(int, bounds)
        if high < low:
            raise UserError(OPTION, f"'{part.strip()}' ends before it begins", f"write {high}-{low}")
        found |= set(range(low, min(high, low + MOST_CURVES) + 1))
    if len(found) > MOST_CURVES:
        raise UserError(OPTION, f"are more than the {MOST_CURVES} that fit into a picture", "choose fewer")
    return tuple(sorted(found))


def numbers_shown(chosen: Sequence[int], there: Collection[int]) -> list[int]:
    """Those chosen, else the first, a middle and the last. Raises `UserError` for one that is not there."""
    missing = [number for number in chosen if number not in there]
    if missing:
        known = f"there are {min(there)} to {max(there)}" if there else "no injection was found"
        raise UserError(OPTION, f"there is no injection {missing[0]}", known)
    ordered = sorted(there)
    return list(chosen) or [ordered[place] for place in shown_numbers(len(ordered))]


def refuse_beyond(chosen: Sequence[int], most: int) -> None:
    """Before the long work: raises `UserError` for a number that no injection of at most so many can have."""
    if chosen and max(chosen) > most:
        raise UserError(
            OPTION, f"there is no injection {max(chosen)}", f"the needle opens {most} times at the most"
        )


def rate_curves(
    report: InjectionReport,
    first_index: int,
    time: Signal,
    trace: Trace,
    measured_rate: Signal | None,
    line_pressure: Signal,
    c: Coefficients,
) -> RateCurves:
    """Of an injection among samples that begin with a sample index.

    time [s], measured_rate [m3/s], line_pressure [Pa]: of these samples.
    """
    first = report.start_index - first_index
    window = slice(first, report.end_index - first_index + 1)
    modelled = trace.x[window, 0] * c.pressure_scale + c.chamber_pressure
    return RateCurves(
        f"injection {report.number}, {report.rail_pressure / MEGAPASCAL:.0f} MPa",
        time[window] - time[first],
        trace.injection_rate[window].copy(),
        trace.nominal_rate[window].copy(),
        None if measured_rate is None else measured_rate[window].copy(),
        trace.injection_rate_sigma[window].copy(),
        PressureCurves(line_pressure[window].copy(), modelled),
    )


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


def _of_report(each: Field[InjectionReport]) -> Field[InjectionResult]:
    return Field(
        each.name, each.kind, lambda r, c: each.get(r.report, c), each.heading, each.form, each.outputs
    )


RESULT_FIELDS: tuple[Field[InjectionResult], ...] = (
    *map(_of_report, FIELDS),
    Field("start_s", float, lambda r, _: r.start, "start\ns", ".3f"),
    Field("end_s", float, lambda r, _: r.end),
    Field("nominal_mass_mg", float, lambda r, _: r.nominal_mass / MILLIGRAM, "nominal\nmg", ".2f"),
    Field("measured_mass_mg", float, lambda r, _: r.measured_mass / MILLIGRAM, "measured\nmg", ".2f"),
    Field("rate_rmse_mm3_per_ms", float, lambda r, _: r.rate_rmse / MM3_PER_MS, "RMSE\nmm3/ms", ".2f"),
    Field("nominal_rate_rmse_mm3_per_ms", float, lambda r, _: r.nominal_rate_rmse / MM3_PER_MS),
    Field(
        "rate_ci95_halfwidth_mm3_per_ms",
        float,
        lambda r, _: r.rate_ci95_halfwidth / MM3_PER_MS,
        outputs=Output.JSON,
    ),
)
"""What is said of an injection, the fields of its report first."""


def injection_json(result: InjectionResult, has_energizing: bool, c: Coefficients) -> dict[str, Any]:
    """One injection of the JSON document."""
    compared = {each.name: each.of(result, c) for each in RESULT_FIELDS[len(FIELDS) :]}
    return {**injection_record(result.report, c, has_energizing), **compared}


def injection_result(
    report: InjectionReport,
    first_index: int,
    time: Signal,
    trace: Trace,
    measured_rate: Signal | None,
    sample_rate: float,
) -> InjectionResult:
    """Over the window an injection was detected in, of samples that begin with a sample index.

    time [s], measured_rate [m3/s]: of the samples of the trace.
    """
    first = report.start_index - first_index
    last = min(report.end_index - first_index, time.size - 1)
    window = slice(first, last + 1)
    interval = 1.0 / sample_rate
    measured = measured_rate[window] if measured_rate is not None else None
    nominal = trace.nominal_rate[window]
    rate = trace.injection_rate[window]

    def mass(rate: NDArray[np.float64]) -> float:
        return float(area(rate)) * interval * report.density

    def rmse(rate: NDArray[np.float64]) -> float:
        return math.nan if measured is None else float(rms_difference(rate, measured))

    return InjectionResult(
        report=report,
        start=float(time[first]),
        end=float(time[last]),
        nominal_mass=mass(nominal),
        measured_mass=math.nan if measured is None else mass(measured),
        rate_rmse=rmse(rate),
        nominal_rate_rmse=rmse(nominal),
        rate_ci95_halfwidth=1.96 * mean_flowing(trace.injection_rate_sigma[window], rate),
    )
