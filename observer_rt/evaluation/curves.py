"""Rate curves of an injection, to be drawn."""

from dataclasses import dataclass

from observer_rt.evaluation.trace import Signal, Trace
from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.service.reports.injection_report import InjectionReport

CURVES = 3  # injections drawn as curves


@dataclass(frozen=True)
class RateCurves:
    """Rates of one injection [m3/s] over time [s].

    reference: what it is compared with, if anything; sigma: standard deviation of the estimated rate, where known.
    """

    title: str
    time: Signal
    estimated: Signal
    nominal: Signal
    reference: Signal | None
    sigma: Signal | None = None


def shown_numbers(injections: int) -> list[int]:
    """The first, a middle and the last one of so many."""
    return sorted({0, injections // 2, injections - 1})[:CURVES] if injections else []


def rate_curves(
    report: InjectionReport, first_index: int, time: Signal, trace: Trace, measured_rate: Signal | None
) -> RateCurves:
    """Of an injection among samples that begin with a sample index; time [s], measured_rate [m3/s]: of these."""
    first = report.start_index - first_index
    window = slice(first, report.end_index - first_index + 1)
    return RateCurves(
        f"injection {report.number}, {report.rail_pressure / MEGAPASCAL:.0f} MPa",
        time[window] - time[first],
        trace.injection_rate[window].copy(),
        trace.nominal_rate[window].copy(),
        None if measured_rate is None else measured_rate[window].copy(),
        trace.injection_rate_sigma[window].copy(),
    )
