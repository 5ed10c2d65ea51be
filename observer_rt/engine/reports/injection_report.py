"""Report of one injection, in SI units, with the one table of names and units for all outputs."""

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Flag, auto
from functools import cached_property
from itertools import chain
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from observer_rt.config.signals import in_units
from observer_rt.core.model.needle import NeedleStroke
from observer_rt.engine.estimation.parameters import NOZZLE, SCALARS, SEAT, ShownIndicator
from observer_rt.engine.learning import mass
from observer_rt.engine.learning.knowledge import EventRecord
from observer_rt.engine.learning.learner import OFTEN
from observer_rt.engine.learning.mass import VolumeBudget
from observer_rt.engine.learning.verdict import WRONG
from observer_rt.engine.reports.indicators import Indicators, indicators_of
from observer_rt.engine.stream.state import Reason, State
from observer_rt.engine.stream.validity import contested, reason_of_injection, until_learned
from observer_rt.foundation.units import MEGAPASCAL, MICROSECOND, MILLIGRAM, MM3_PER_MS, Z_95, Floats
from observer_rt.model.accuracy import EXACT, StatedAccuracy
from observer_rt.model.effective import Coefficients
from observer_rt.model.surroundings import Surroundings

NOTEWORTHY, SURELY = 0.01, 3.0  # remainder that is put into words: share of the flow, standard deviations of the mass
SURROUNDINGS = tuple(in_units(Surroundings(*[0.0] * len(Surroundings._fields))))  # names of values
_NUMBERS = ("number", "event", "start_position", "end_position", "start_index", "end_index", "phi_version")

T = TypeVar("T", contravariant=True)  # a field of a report is one of whatever derives from it
Value = int | float | str | None


@dataclass(frozen=True)
class CommandedOpening:
    """Command that an opening belongs to, and what it shows of the injector; nan: not known."""

    command: int  # its number
    opening_delay: float  # from the start of energizing to the first sample with the needle open [s]
    energizing_time: float  # s

    def as_text(self) -> str:
        """Describes command and opening delay in a few words."""
        if math.isnan(self.opening_delay):
            return f"command {self.command}"
        return f"command {self.command}, opened after {self.opening_delay / MICROSECOND:.0f} us"


@dataclass(frozen=True, eq=False)
class InjectionReport:
    """One injection, judged with its event; a position counts samples received, an index is the device's.

    Volume and mass are by its own pressures where its event was learned from, else of the live rate.
    """

    number: int  # counted by the observer, from 1
    event: int
    start_position: int
    end_position: int
    start_index: int
    end_index: int
    volume: float  # m3
    mass: float  # kg
    live_mass: float  # of the live rate [kg]; nan: some sample had no rate
    predicted_mass: float  # of x^ [kg]: what was learned before its event says of it
    rate_sigma: Floats | None  # (n,) standard deviation of `corrected_rate` [m3/s]
    corrected_rate: Floats | None  # (n,) by its own pressures [m3/s]; None: not learned from
    peak_rate: float  # of the live rate [m3/s]; nan: some sample had no rate
    rail_pressure: float  # at the opening [Pa]
    valid: bool  # whether rate and mass are to be used
    reason: Reason  # the most severe
    state: State
    phi_version: int  # number of the learned correction in force
    indicators: Indicators  # learned parameters, normalised, in the middle of the injection
    density: float  # of the fuel [kg/m3]
    surroundings: Surroundings  # as measured
    commanded: CommandedOpening | None  # None: not known
    further: tuple[Reason, ...] = ()  # other reasons
    known_rails: tuple[float, float] = (-math.inf, math.inf)  # [Pa] at which the flow was known when it opened
    posterior: Sequence[tuple[str, float]] = ()  # what its event may be, the likeliest first; empty: not learned from
    calibration: StatedAccuracy = EXACT  # of the level
    budget: VolumeBudget | None = None  # of the volume's uncertainty; None: not learned from
    recurs: bool = False  # the flow has changed in some of the events before, too
    stroke: NeedleStroke | None = None  # of the needle, in s from the start on; None: recorded, or not learned from

    @property
    def posterior_text(self) -> str:
        """What its event may be, in words."""
        return ", ".join(f"{name} {probability:.2f}".replace("0.", ".") for name, probability in self.posterior)

    @property
    def validity(self) -> str:
        """Validity, source of the mass and calibration of its level in words, without the reasons."""
        if not self.valid:
            return "not valid"
        source = "" if self.budget else ", mass of the live rate, without an interval"
        return f"valid{source}" if self.calibration.is_calibrated else f"valid{source}, not calibrated"

    @property
    def mass_bound(self) -> float:
        """Error that the mass may have, by the interval with 95 % [kg]; nan before that is known."""
        return math.nan if self.budget is None else Z_95 * math.hypot(*self.budget) * self.density

    @property
    def mass_ci95(self) -> tuple[float, float] | None:
        """95 % interval of the mass [kg]; None before that is known."""
        return None if self.budget is None else (self.mass - self.mass_bound, self.mass + self.mass_bound)

    @property
    def relative_sigma(self) -> float:
        """Standard deviation of the mass as a share of it, without the level's; nan where it is not known."""
        return self.budget.beyond_level / self.volume if self.budget and self.volume > 0.0 else math.nan

    @property
    def remainder(self) -> float:
        """Share by which the mass is larger than what was learned before predicted; nan where either is not known."""
        return self.mass / self.predicted_mass - 1.0 if self.budget and self.predicted_mass > 0.0 else math.nan

    @property
    def remainder_text(self) -> str:
        """Remainder in words; empty where it is not certain, or too small to matter."""
        if not abs(self.remainder) >= max(NOTEWORTHY, SURELY * self.relative_sigma):
            return ""
        side = "above" if self.remainder > 0.0 else "below"
        reference = "what was learned" if self.phi_version else "the model"
        again = "; it changes again and again, so run discover" if self.recurs else ""
        return f"flow {100.0 * abs(self.remainder):.0f} % {side} {reference}{again}"

    def without_courses(self) -> "InjectionReport":
        """This report without the courses of rates over its window, which take most of its memory."""
        return replace(self, rate_sigma=None, corrected_rate=None)

    @property
    def reasons(self) -> tuple[Reason, ...]:
        """Reasons why the injection is not valid, the most severe first."""
        return () if self.valid else (self.reason, *self.further)


def beyond_learned(report: InjectionReport) -> str:
    """Describes how far an injection is from what was learned, and which recording would help."""
    rail_pressure, (lowest, highest) = report.rail_pressure, report.known_rails
    if lowest <= rail_pressure <= highest:
        budget, percent = report.budget, 100.0 * Z_95 / report.volume if report.volume > 0.0 else math.nan
        if budget is not None and SURELY * report.relative_sigma > WRONG:
            return (
                f"its mass is known to {percent * budget.beyond_level:.1f} %, but valid from "
                f"{100.0 * Z_95 * WRONG / SURELY:.0f} % on: {percent * budget.parameters:.1f} % are left open by "
                f"events, of which more help, {percent * budget.model:.1f} % by the model, where a better fit helps"
            )
        bound = "" if budget is None else f", its mass to {percent * budget.learning:.1f} %"
        return f"its rail pressure is known{bound}, its duration or lift is not; record some as short or as long"
    reaches = [f"from {lowest / MEGAPASCAL:.0f}"] if math.isfinite(lowest) else []
    reaches += [f"up to {highest / MEGAPASCAL:.0f}"] if math.isfinite(highest) else []
    learned = f"what was learned reaches {' '.join(reaches)} MPa" if reaches else "nothing learned reaches it"
    return f"{learned}; record injections at {rail_pressure / MEGAPASCAL:.0f} MPa, short and long"


def report_of(
    injection: np.void, judged: EventRecord, commanded: CommandedOpening | None, is_contested: bool = False
) -> InjectionReport:
    """Report of an injection (row of `stream.state.INJECTION`); is_contested: another node sends its results."""

    def pressure(name: str) -> float:
        return float(injection[name]) * c.pressure_scale + c.chamber_pressure

    event, outcome = judged.event, judged.outcome
    constants = judged.constants
    c = constants.coefficients
    middle = injection["middle_x"], injection["middle_u"]
    theta = judged.knowledge.in_force if outcome is None else outcome.estimate
    covariance = None if outcome is None else outcome.covariance
    points = () if outcome is None else outcome.knowledge.state.learned.learned_at
    rails = [point.rail_pressure for point in points]
    indicators = indicators_of(theta, covariance, *middle, constants.calibration, rails, constants.needle is None)
    volume = live_volume = float(injection["volume"])
    sigma, budget, corrected, stroke = None, None, None, None
    belongs = injection["event"] == event["number"]
    if belongs and outcome is not None and outcome.resimulated is not None:
        again, first = outcome.resimulated, int(event["start_position"])
        window = slice(int(injection["start_position"]) - first, int(injection["end_position"]) - first + 1)
        volume, budget = mass.volume_in(again, window), mass.volume_budget(again, window)
        corrected, sigma = mass.corrected_rate(again, window), mass.rate_sigma(again, window)
        stroke = mass.stroke_in(again, window)
    passed = not judged.objections
    reason = reason_of_injection(
        of_samples=Reason(int(injection["reason"])),
        of_event=Reason.NONE if passed else judged.objections[0].reason,
        of_inputs=Reason(int(event["fault"])),
        was_outlier=passed and outcome is not None and outcome.outliers > 0,
        is_learned=corrected is not None,
    )
    reason = until_learned(reason) if judged.is_late else reason
    state = State(int(injection["state"]))
    reasons: tuple[Reason, ...] = (reason,)
    if is_contested:
        state, reasons = contested(state, reason)
    return InjectionReport(
        **{name: int(injection[name]) for name in _NUMBERS},
        volume=volume,
        mass=volume * c.density,
        live_mass=live_volume * c.density,
        predicted_mass=float(injection["predicted_volume"]) * c.density,
        peak_rate=float(injection["peak_rate"]),
        rail_pressure=pressure("rail_pressure"),
        known_rails=(pressure("known_from"), pressure("known_to")),
        rate_sigma=sigma,
        corrected_rate=corrected,
        valid=reasons[0] is Reason.NONE,
        reason=reasons[0],
        state=state,
        indicators=indicators,
        density=c.density,
        surroundings=constants.surroundings,
        commanded=commanded,
        further=reasons[1:],
        posterior=outcome.posterior if belongs and outcome is not None else (),
        calibration=constants.calibration,
        budget=budget,
        recurs=outcome is not None and outcome.knowledge.state.changes > OFTEN,
        stroke=stroke,
    )


class Output(Flag):
    """Output in which a value has a name of its own; in JSON, commands and indicators stand below one name."""

    JSON = auto()
    JOURNAL = auto()
    PARQUET = auto()


@dataclass(frozen=True)
class Field(Generic[T]):
    """A value reported of an injection, in the unit that ends its name; nan and None: not known."""

    name: str
    kind: type  # tuple for an interval, list for names
    get: Callable[[T, Coefficients], Any]  # from the injection and the nominal model
    heading: str = ""  # in tables on the screen
    form: str = ""  # in tables on the screen
    outputs: Output = ~Output(0)

    @cached_property
    def columns(self) -> dict[str, type]:
        """Names and types in a table: an interval has two."""
        if self.kind is tuple:
            return {self.name.replace("_ci95", f"_ci95_{end}"): float for end in ("low", "high")}
        return {self.name: str if self.kind is list else self.kind}

    def of(self, injection: T, c: Coefficients) -> Any:
        """Value of an injection as JSON has it."""
        value = self.get(injection, c)
        return none_if_nan(value) if isinstance(value, float) else value

    def cells(self, injection: T, c: Coefficients) -> Sequence[Value]:
        """Cells of its columns."""
        value = self.of(injection, c)
        if self.kind is tuple:
            return value or (None, None)
        return [",".join(value) if self.kind is list else value]

    def text(self, value: Any) -> str:
        """Text of a value on the screen."""
        if value is None:
            return "-"
        return "-".join(format(each, self.form) for each in (value if self.kind is tuple else [value]))


class IndicatorFields(NamedTuple):
    """Two fields of an indicator of the injector, with its name and unit in JSON."""

    name: str
    unit: str
    value: Field[InjectionReport]
    ci95: Field[InjectionReport]

    @property
    def columns(self) -> tuple[str, ...]:
        """Column names of its value and of the ends of its interval."""
        return (*self.value.columns, *self.ci95.columns)


def _indicator(shown: ShownIndicator) -> IndicatorFields:
    name, unit = shown.key or shown.effect, shown.unit[0]
    suffix = "" if unit == "-" else "_" + re.sub(r"\W+", "_", unit.replace("/", " per ")).strip("_")

    def value(report: InjectionReport, c: Coefficients) -> float | None:
        estimate = report.indicators.get(shown.effect)
        return None if estimate is None else estimate.value * shown.factor(c)

    def ci95(report: InjectionReport, c: Coefficients) -> list[float] | None:
        estimate = report.indicators.get(shown.effect)
        bounds = None if estimate is None else estimate.ci95
        return bounds and [bound * shown.factor(c) for bound in bounds]

    outputs, heading = Output.JOURNAL | Output.PARQUET, f"{name.partition('_')[0]}\nflow"
    single = Field(f"{name}{suffix}", float, value, heading, "+.1%", outputs)
    return IndicatorFields(name, unit, single, Field(f"{name}_ci95{suffix}", tuple, ci95, outputs=outputs))


INDICATORS = tuple(_indicator(shown) for _, shown in SCALARS.shown())
WEAR = tuple(_indicator(shown) for _, shown in SCALARS.shown() if shown.effect in (NOZZLE, SEAT))
_INDEX = Output.JSON | Output.JOURNAL  # a recording tells time instead


def _mass_part(name: str, part: Callable[[VolumeBudget], float]) -> Field[InjectionReport]:
    """Half of the mass's 95 % interval by a part of its budget alone."""

    def half(report: InjectionReport, _: Coefficients) -> float:
        return math.nan if report.budget is None else Z_95 * part(report.budget) * report.density / MILLIGRAM

    return Field(f"mass_{name}_mg", float, half, outputs=Output.JSON | Output.PARQUET)


def _surrounding(name: str) -> Field[InjectionReport]:
    return Field(name, float, lambda r, _: in_units(r.surroundings).get(name))


# fmt: off
_COMMAND: tuple[Field[InjectionReport], ...] = (
    Field("command", int, lambda r, _: r.commanded and r.commanded.command, "command\nno", "d", Output.JOURNAL),
    Field("opening_delay_us", float, lambda r, _: r.commanded and r.commanded.opening_delay / MICROSECOND,
          "delay\nus", ".0f", Output.JOURNAL),
    Field("energizing_time_us", float, lambda r, _: r.commanded and r.commanded.energizing_time / MICROSECOND,
          outputs=Output.JOURNAL | Output.PARQUET),
)
FIELDS: tuple[Field[InjectionReport], ...] = (
    Field("number", int, lambda r, _: r.number, "\nno", "d"),
    Field("event", int, lambda r, _: r.event, "\nevent", "d"),
    Field("start_index", int, lambda r, _: r.start_index, outputs=_INDEX),
    Field("end_index", int, lambda r, _: r.end_index, outputs=_INDEX),
    Field("rail_pressure_MPa", float, lambda r, _: r.rail_pressure / MEGAPASCAL, "rail\nMPa", ".1f"),
    Field("mass_mg", float, lambda r, _: r.mass / MILLIGRAM, "mass\nmg", ".2f"),
    Field("mass_ci95_mg", tuple, lambda r, _: r.mass_ci95 and [bound / MILLIGRAM for bound in r.mass_ci95]),
    Field("mass_source", str, lambda r, _: "event" if r.budget else "live_rate"),
    Field("live_mass_mg", float, lambda r, _: r.live_mass / MILLIGRAM),
    Field("predicted_mass_mg", float, lambda r, _: r.predicted_mass / MILLIGRAM),
    Field("remainder_percent", float, lambda r, _: 100.0 * r.remainder),
    _mass_part("noise", lambda budget: budget.inputs),
    _mass_part("learning", lambda budget: budget.learning),
    _mass_part("calibration", lambda budget: budget.calibration),
    Field("peak_rate_mm3_per_ms", float, lambda r, _: r.peak_rate / MM3_PER_MS, outputs=Output.JOURNAL),
    Field("valid", bool, lambda r, _: r.valid),
    Field("reasons", list, lambda r, _: [reason.name for reason in r.reasons]),
    Field("state", str, lambda r, _: r.state.name),
    Field("posterior", str, lambda r, _: r.posterior_text),
    Field("phi_version", int, lambda r, _: r.phi_version),
    *map(_surrounding, SURROUNDINGS),
    *_COMMAND,
    *chain.from_iterable((each.value, each.ci95) for each in INDICATORS),
)
# fmt: on
MASS_BOUND = Field[InjectionReport](
    "mass_bound_mg", float, lambda r, _: r.mass_bound / MILLIGRAM, "± 95 %\nmg", ".1f"
)
WITH_BOUND = (*FIELDS, MASS_BOUND)
NAMED = {each.name: each for each in WITH_BOUND}


def columns_of(fields: Sequence[Field[T]], output: Output) -> dict[str, type]:
    """Names and types of the columns that an output has of these fields."""
    return {name: kind for each in fields if output in each.outputs for name, kind in each.columns.items()}


def row_of(fields: Sequence[Field[T]], output: Output, injection: T, c: Coefficients) -> dict[str, Value]:
    """Values for every column of `columns_of`; c: of the nominal model, as below."""
    row: dict[str, Value] = {}
    for field in fields:
        if output in field.outputs:
            row.update(zip(field.columns, field.cells(injection, c), strict=True))
    return row


def injection_record(report: InjectionReport, c: Coefficients, has_energizing: bool) -> dict[str, Any]:
    """Record of an injection in JSON, by names that end in their units, with its indicators and their intervals.

    c: of the nominal model; has_energizing: whether its command is reported, None without one.
    """
    record = {each.name: each.of(report, c) for each in FIELDS if Output.JSON in each.outputs}
    for name in {*SURROUNDINGS} - in_units(report.surroundings).keys():
        del record[name]
    record["indicators"] = {
        each.name: {"value": each.value.of(report, c), "ci95": each.ci95.of(report, c), "unit": each.unit}
        for each in INDICATORS
        if each.value.get(report, c) is not None
    }
    if has_energizing:
        record["energizing"] = report.commanded and {each.name: each.of(report, c) for each in _COMMAND}
    return record


def none_if_nan(value: float) -> float | None:
    """Number, or None for nan, which JSON has no word for."""
    return None if math.isnan(value) else value
