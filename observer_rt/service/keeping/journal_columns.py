"""What the journal says of an injection: columns with a type, and their units in their names."""

import re
from dataclasses import dataclass
from datetime import UTC, datetime

from observer_rt.estimation.scalars import NOZZLE, SCALARS, SEAT, Shown
from observer_rt.foundation.units import MILLIGRAM, MM3_PER_MS
from observer_rt.model.coefficients import Coefficients
from observer_rt.service.reports.injection_record import energizing_record, injection_record, known
from observer_rt.service.reports.injection_report import InjectionReport

Value = int | float | str | None


@dataclass(frozen=True)
class Column:
    """A column of the journal; kind: INTEGER, REAL or TEXT of SQLite."""

    name: str
    kind: str


@dataclass(frozen=True)
class Indicator:
    """What is learned of an injector, as columns: the value and the ends of its 95 % interval."""

    name: str
    unit: str  # as people write it
    value: str
    low: str
    high: str


def _indicator(shown: Shown) -> Indicator:
    name, unit = shown.key or shown.effect, shown.unit[0]
    suffix = "" if unit == "-" else "_" + re.sub(r"\W+", "_", unit.replace("/", " per ")).strip("_")
    low, high = (f"{name}_ci95_{end}{suffix}" for end in ("low", "high"))
    return Indicator(name, unit, f"{name}{suffix}", low, high)


INDICATORS = tuple(_indicator(shown) for _, shown in SCALARS.shown())
WEAR = tuple(_indicator(shown) for _, shown in SCALARS.shown() if shown.effect in (NOZZLE, SEAT))
COLUMNS = (
    Column("number", "INTEGER"),  # of the run, from 1
    Column("event", "INTEGER"),
    Column("judged_utc", "TEXT"),
    Column("start_index", "INTEGER"),  # of the device's samples, as the next
    Column("end_index", "INTEGER"),
    Column("rail_pressure_MPa", "REAL"),
    Column("mass_mg", "REAL"),
    Column("mass_ci95_low_mg", "REAL"),
    Column("mass_ci95_high_mg", "REAL"),
    Column("measured_mass_mg", "REAL"),
    Column("peak_rate_mm3_per_ms", "REAL"),
    Column("valid", "INTEGER"),  # 0 or 1
    Column("reasons", "TEXT"),  # by commas, empty where valid
    Column("state", "TEXT"),
    Column("phi_version", "INTEGER"),
    Column("fuel_temperature_degC", "REAL"),
    Column("command", "INTEGER"),
    Column("opening_delay_us", "REAL"),
    Column("energizing_time_us", "REAL"),
    *(Column(name, "REAL") for each in INDICATORS for name in (each.value, each.low, each.high)),
)


def row_of(report: InjectionReport, c: Coefficients, judged_ns: int) -> dict[str, Value]:
    """A value for every column, None for what is not known. c: of the nominal model; judged_ns: Unix time [ns]."""
    record = injection_record(report, c)
    row: dict[str, Value] = {
        **dict.fromkeys(column.name for column in COLUMNS),
        **{name: value for name, value in record.items() if isinstance(value, int | float | str)},
        "judged_utc": utc(judged_ns),
        "start_index": report.start_index,
        "end_index": report.end_index,
        "peak_rate_mm3_per_ms": known(report.peak_rate / MM3_PER_MS),
        "reasons": ",".join(record["reasons"]),
        **(energizing_record(report.commanded) or {}),
    }
    if report.mass_ci95 is not None:
        row["mass_ci95_low_mg"], row["mass_ci95_high_mg"] = (bound / MILLIGRAM for bound in report.mass_ci95)
    for indicator in INDICATORS:
        estimate = record["indicators"][indicator.name]
        row[indicator.value] = estimate["value"]
        row[indicator.low], row[indicator.high] = estimate["ci95"] or (None, None)
    return {column.name: row[column.name] for column in COLUMNS}


def utc(unix_ns: int) -> str:
    """A Unix time [ns] as SQLite and people read it, to the millisecond."""
    seconds, rest = divmod(unix_ns, 1_000_000_000)
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%d %H:%M:%S}.{rest // 1_000_000:03d}"
