"""Curves of an injection, to be drawn; and which injections are."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from observer_rt.evaluation.trace import Signal, Trace
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.model.coefficients import Coefficients
from observer_rt.service.reports.injection_report import InjectionReport

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
