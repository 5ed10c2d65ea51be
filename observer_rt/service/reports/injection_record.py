"""Names what is said of an injection, with units: one table for JSON, the journal, Parquet and the screen."""

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Flag, auto
from functools import cached_property
from itertools import chain
from typing import Any, Generic, TypeVar

from observer_rt.estimation.scalars import NOZZLE, SCALARS, SEAT, ShownIndicator
from observer_rt.foundation.units import MEGAPASCAL, MICROSECOND, MILLIGRAM, MM3_PER_MS, ZERO_CELSIUS
from observer_rt.model.coefficients import Coefficients
from observer_rt.service.reports.injection_report import InjectionReport

T = TypeVar("T")
Value = int | float | str | None


class Output(Flag):
    """Where a value goes as a name of its own; in JSON, commands and indicators stand below one name."""

    JSON = auto()
    JOURNAL = auto()
    PARQUET = auto()


@dataclass(frozen=True)
class Field(Generic[T]):
    """A value that is said of an injection, in the unit that ends its name; nan and None: not known.

    get: from the injection and the nominal model; kind: tuple for an interval, list for names; heading and form:
    in tables on the screen.
    """

    name: str
    kind: type
    get: Callable[[T, Coefficients], Any]
    heading: str = ""
    form: str = ""
    outputs: Output = ~Output(0)

    @cached_property
    def columns(self) -> dict[str, type]:
        """Names and types in a table: an interval has two."""
        if self.kind is tuple:
            return {self.name.replace("_ci95", f"_ci95_{end}"): float for end in ("low", "high")}
        return {self.name: str if self.kind is list else self.kind}

    def of(self, injection: T, c: Coefficients) -> Any:
        """As JSON has it."""
        value = self.get(injection, c)
        return known(value) if isinstance(value, float) else value

    def cells(self, injection: T, c: Coefficients) -> Sequence[Value]:
        """One for each column."""
        value = self.of(injection, c)
        if self.kind is tuple:
            return value or (None, None)
        return [",".join(value) if self.kind is list else value]

    def text(self, value: Any) -> str:
        """A value on the screen."""
        if value is None:
            return "-"
        return "-".join(format(each, self.form) for each in (value if self.kind is tuple else [value]))


@dataclass(frozen=True)
class IndicatorFields:
    """What is learned of an injector, as two fields; name and unit are those of JSON."""

    name: str
    unit: str
    value: Field[InjectionReport]
    ci95: Field[InjectionReport]

    @property
    def columns(self) -> tuple[str, ...]:
        """Of its value and of the ends of its interval."""
        return (*self.value.columns, *self.ci95.columns)


def _indicator(shown: ShownIndicator) -> IndicatorFields:
    name, unit = shown.key or shown.effect, shown.unit[0]
    suffix = "" if unit == "-" else "_" + re.sub(r"\W+", "_", unit.replace("/", " per ")).strip("_")

    def value(report: InjectionReport, c: Coefficients) -> float:
        return report.indicators[shown.effect].value * shown.factor(c)

    def ci95(report: InjectionReport, c: Coefficients) -> list[float] | None:
        interval = report.indicators[shown.effect].ci95
        return interval and [bound * shown.factor(c) for bound in interval]

    outputs, heading = Output.JOURNAL | Output.PARQUET, f"{name.partition('_')[2]}\n{unit}"
    single = Field(f"{name}{suffix}", float, value, heading, "+.3f", outputs)
    return IndicatorFields(name, unit, single, Field(f"{name}_ci95{suffix}", tuple, ci95, outputs=outputs))


INDICATORS = tuple(_indicator(shown) for _, shown in SCALARS.shown())
WEAR = tuple(_indicator(shown) for _, shown in SCALARS.shown() if shown.effect in (NOZZLE, SEAT))
_INDEX = Output.JSON | Output.JOURNAL  # a recording tells time instead
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
    Field("mass_ci95_mg", tuple, lambda r, _: r.mass_ci95 and [bound / MILLIGRAM for bound in r.mass_ci95],
          "95 %\nmg", ".1f"),
    Field("peak_rate_mm3_per_ms", float, lambda r, _: r.peak_rate / MM3_PER_MS, outputs=Output.JOURNAL),
    Field("valid", bool, lambda r, _: r.valid),
    Field("reasons", list, lambda r, _: [reason.name for reason in r.reasons]),
    Field("state", str, lambda r, _: r.state.name),
    Field("phi_version", int, lambda r, _: r.phi_version),
    Field("fuel_temperature_degC", float, lambda r, _: r.fuel_temperature and r.fuel_temperature - ZERO_CELSIUS),
    *_COMMAND,
    *chain.from_iterable((each.value, each.ci95) for each in INDICATORS),
)
# fmt: on
NAMED = {each.name: each for each in FIELDS}


def columns_of(fields: Sequence[Field[T]], output: Output) -> dict[str, type]:
    """Names and types of the columns that an output has of these fields."""
    return {name: kind for each in fields if output in each.outputs for name, kind in each.columns.items()}


def row_of(fields: Sequence[Field[T]], output: Output, injection: T, c: Coefficients) -> dict[str, Value]:
    """A value for every column of `columns_of`; c: of the nominal model, as below."""
    row: dict[str, Value] = {}
    for each in fields:
        if output in each.outputs:
            row.update(zip(each.columns, each.cells(injection, c), strict=True))
    return row


def injection_record(report: InjectionReport, c: Coefficients, has_energizing: bool) -> dict[str, Any]:
    """An injection in JSON. has_energizing: whether its command is said, None without one."""
    record = {each.name: each.of(report, c) for each in FIELDS if Output.JSON in each.outputs}
    if report.fuel_temperature is None:
        del record["fuel_temperature_degC"]
    record["indicators"] = {
        each.name: {"value": each.value.of(report, c), "ci95": each.ci95.of(report, c), "unit": each.unit}
        for each in INDICATORS
    }
    if has_energizing:
        record["energizing"] = report.commanded and {each.name: each.of(report, c) for each in _COMMAND}
    return record


def known(value: float) -> float | None:
    """None for nan, which JSON has no word for."""
    return None if math.isnan(value) else value
