"""An injection against the nominal model and, where there is one, the measurement: figures and curves."""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from observer_rt.core.model.needle import NeedleStroke, lift_of_stroke
from observer_rt.desk.evaluation.trace import InjectionSamples, trace_of
from observer_rt.engine.estimation.parameters import NEEDLE_LAW, SCALARS, ShownIndicator
from observer_rt.engine.reports.indicators import Estimate
from observer_rt.engine.reports.injection_report import FIELDS, MASS_BOUND, Field, InjectionReport, Output
from observer_rt.engine.stream.state import Reason
from observer_rt.files.signals.recording import shown_slowly
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MILLISECOND, MM3_PER_MS, Z_95, Floats
from observer_rt.model.effective import Coefficients


@dataclass(frozen=True)
class MassRow:
    """Masses of one injection [kg], and the wear learned by it, by effect."""

    number: int
    estimated: float
    nominal: float
    reference: float | None
    valid: bool
    ci95: tuple[float, float] | None = None
    wear: Mapping[str, Estimate] = field(default_factory=dict)
    posterior: Sequence[tuple[str, float]] = ()


@dataclass(frozen=True, eq=False)
class RateCurves:
    """Rates of one injection [m3/s] over time [s]."""

    title: str
    time: Floats
    estimated: Floats
    nominal: Floats
    reference: Floats | None  # what the estimate is compared with, if anything
    sigma: Floats | None = None  # standard deviation of the corrected rate
    corrected: Floats | None = None  # rate by the injection's own pressures, where known
    line: tuple[Floats, Floats] | None = None  # line pressure [Pa] measured, and observed open loop
    lift: tuple[Floats, str] | None = None  # [m], learned where it is not recorded; what else was learned, in words
    live_sigma: Floats | None = None  # standard deviation of the estimated rate, as it was known while that was sent


def numbers_shown(chosen: Sequence[int], present: Collection[int]) -> list[int]:
    """Numbers chosen, else the first, a middle and the last. Raises `UserError` for an unknown number."""
    missing = [number for number in chosen if number not in present]
    if missing:
        choices = f"there are {min(present)} to {max(present)}" if present else "no injection was found"
        raise UserError("injections", f"there is no injection {missing[0]}", choices)
    ordered = sorted(present)
    places = sorted({0, len(ordered) // 2, len(ordered) - 1}) if ordered else ()
    return list(chosen) or [ordered[place] for place in places]


def rate_curves(report: InjectionReport, samples: InjectionSamples, c: Coefficients, has_rate: bool) -> RateCurves:
    """Curves of an injection, as far as its samples are remembered; has_rate: measured."""
    trace = trace_of(samples.trace.copy())
    chamber = report.surroundings.chamber_pressure or c.chamber_pressure
    measured, modelled = (c.pressure_scale * pressure + chamber for pressure in (trace.line_pressure, trace.x[:, 0]))
    return RateCurves(
        f"injection {report.number}, {report.rail_pressure / MEGAPASCAL:.0f} MPa",
        trace.time - samples.start,
        trace.injection_rate,
        trace.nominal_rate,
        trace.measured_rate if has_rate else None,
        trace.corrected_rate_sigma,
        trace.corrected_rate,
        (measured, modelled),
        None if report.stroke is None else _learned_lift(report, report.stroke, trace.time - samples.start, c),
        trace.injection_rate_sigma,
    )


def _learned_lift(report: InjectionReport, stroke: NeedleStroke, time: Floats, c: Coefficients) -> tuple[Floats, str]:
    """Lift [m] at times (n,) [s] in the window, and delays, speeds and landing, with 95 % intervals, in words."""
    learned = [shown for column, shown in SCALARS.shown() if column in NEEDLE_LAW.columns]
    estimates = ((shown, report.indicators[shown.effect]) for shown in learned)
    lines = [in_words(shown, estimate, c) for shown, estimate in estimates if estimate.sigma]  # else it is not in use
    lines.append(f"lands at {stroke.closed / MILLISECOND:.3f} ms")
    return np.array([lift_of_stroke(moment, stroke) for moment in time.tolist()]), "\n".join(lines)


def in_words(shown: ShownIndicator, estimate: Estimate, c: Coefficients) -> str:
    """Label, value and half width of the 95 % interval of an indicator, in the unit of screens."""
    unit = shown.screen_unit or shown.unit
    value, sigma = (figure * shown.factor(c, unit) for figure in (estimate.value, estimate.sigma or math.nan))
    return f"{shown.label} = {value:+.3g} ± {Z_95 * sigma:.2g} {unit[0]}".removesuffix(" -")


@dataclass(frozen=True, eq=False, kw_only=True)
class InjectionResult(InjectionReport):
    """An injection compared with the nominal model and, where measured, the measurement (SI; nan: not known)."""

    start: float  # s
    end: float  # s
    nominal_mass: float  # kg
    measured_mass: float  # kg
    rate_rmse: float  # m3/s
    nominal_rate_rmse: float  # m3/s
    rate_ci95_halfwidth: float  # m3/s, of the corrected rate, mean while it flows


RESULT_FIELDS: tuple[Field[InjectionResult], ...] = (
    *FIELDS,
    Field("start_s", float, lambda r, _: r.start, "start\ns", ".3f"),
    Field("end_s", float, lambda r, _: r.end),
    Field("nominal_mass_mg", float, lambda r, _: r.nominal_mass / MILLIGRAM, "nominal\nmg", ".2f"),
    Field("measured_mass_mg", float, lambda r, _: r.measured_mass / MILLIGRAM, "measured\nmg", ".2f"),
    Field("rate_rmse_mm3_per_ms", float, lambda r, _: r.rate_rmse / MM3_PER_MS, "RMSE\nmm3/ms", ".2f"),
    Field("nominal_rate_rmse_mm3_per_ms", float, lambda r, _: r.nominal_rate_rmse / MM3_PER_MS),
    Field(
        "rate_ci95_halfwidth_mm3_per_ms", float, lambda r, _: r.rate_ci95_halfwidth / MM3_PER_MS, outputs=Output.JSON
    ),
)
"""Fields of an evaluated injection, those of its report first."""
_SCREEN_FIELDS: tuple[Field[InjectionResult], ...] = (*RESULT_FIELDS, MASS_BOUND)
SHOWN: Mapping[str, Field[InjectionResult]] = {shown.name: shown for shown in _SCREEN_FIELDS}
"""Fields of an evaluated injection on the screen, by name."""


def injection_result(
    report: InjectionReport, samples: InjectionSamples, sample_rate: float, has_rate: bool, meter: Iterable[float]
) -> InjectionResult:
    """Result over the window an injection was detected in, without courses; nan where not all of it is remembered.

    meter: time constants [s] by which a measured rate is late; the mass it shows too late is the estimate's.
    """
    trace, is_known = samples.trace, samples.is_whole
    measured = trace.measured_rate if has_rate and is_known else None
    nominal, rate = trace.nominal_rate, trace.injection_rate
    if report.reason is Reason.NO_COMMAND:
        nominal = np.full(nominal.size, math.nan)  # it knows of no opening

    def mass(rate: Floats) -> float:
        return float(np.trapezoid(rate)) * (1.0 / sample_rate) * report.density

    def shown(rate: Floats) -> Floats:
        return shown_slowly(rate, 1.0 / sample_rate, *meter)

    def rmse(rate: Floats) -> float:
        return math.nan if measured is None or not rate.size else math.sqrt(np.mean((shown(rate) - measured) ** 2))

    flowing = trace.corrected_rate_sigma[rate != 0.0]
    return InjectionResult(
        **vars(report.without_courses()),
        start=samples.start,
        end=samples.end,
        nominal_mass=mass(nominal) if is_known else math.nan,
        measured_mass=math.nan if measured is None else mass(measured) + mass(rate) - mass(shown(rate)),
        rate_rmse=rmse(np.where(np.isnan(trace.corrected_rate), rate, trace.corrected_rate)),
        nominal_rate_rmse=rmse(nominal),
        rate_ci95_halfwidth=Z_95 * float(np.mean(flowing)) if flowing.size else math.nan,
    )
