"""What is said of one injection against the nominal model and, where there is one, the measurement."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.evaluation.compiled import area, mean_flowing, rms_difference
from observer_rt.evaluation.trace import Signal, Trace
from observer_rt.foundation.units import MILLIGRAM, MM3_PER_MS
from observer_rt.model.coefficients import Coefficients
from observer_rt.service.reports.injection_record import FIELDS, Field, Output, injection_record
from observer_rt.service.reports.injection_report import InjectionReport


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
    online_mass: float | None,
) -> InjectionResult:
    """Over the window an injection was detected in, of samples that begin with a sample index.

    time [s], measured_rate [m3/s]: of the samples of the trace; online_mass [kg]: as measured online, None: it was
    not; a measured rate goes before it.
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

    unmeasured = math.nan if online_mass is None else online_mass
    return InjectionResult(
        report=report,
        start=float(time[first]),
        end=float(time[last]),
        nominal_mass=mass(nominal),
        measured_mass=unmeasured if measured is None else mass(measured),
        rate_rmse=rmse(rate),
        nominal_rate_rmse=rmse(nominal),
        rate_ci95_halfwidth=1.96 * mean_flowing(trace.injection_rate_sigma[window], rate),
    )
