"""Measured masses of recordings, read from a table of masses, or of the integrals of a rate meter's tables."""

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np

from observer_rt.config.injector_sections import RecordingConfig, TimeConfig
from observer_rt.files.signals.csv_dialect import NAME_WITH_UNIT, dialect_of
from observer_rt.files.signals.csv_table import CsvTable
from observer_rt.files.signals.naming import chosen, name_and_unit
from observer_rt.files.signals.table import TIME, Heading
from observer_rt.files.signals.table_signals import MASS_RATE_UNITS, UNITS
from observer_rt.foundation.errors import UserError, file_errors
from observer_rt.foundation.units import MILLIGRAM
from observer_rt.identification.likelihood.measurement import Measurement

INJECTION_RATE = "injection_rate"
RECORDING, INJECTION, MASS, RATE, NAMES = "recording", "injection", "mass_mg", "rate_file", "names"
MEAN = 0  # in place of the number of an injection
SIGMA, PERCENT = "sigma_mg", "sigma_percent"  # one of both, if any
SHARE_SIGMA = 0.005  # of a mass whose uncertainty is not stated: a good injection analyser
LARGEST_MASS = 2000.0  # mg
FLOWS = 0.2  # of the highest rate of a meter, above which it shows an injection
EVENT_GAP = 10e-3  # s without such a rate, beyond which another injection begins, as in `[learning] event_gap_ms`
_EXAMPLE = (
    f"write {RECORDING},{MASS}[,{SIGMA}] with lines such as healthy_60.csv,31.4, or of single injections "
    f"{RECORDING},{INJECTION},{MASS} with healthy_60.csv,1,31.4, or of a rate meter's tables "
    f"{RECORDING},{RATE}[,{PERCENT}] with healthy_60.csv,tube_60.txt"
)
_HEADED = (
    "write names and units of its columns above the numbers, such as: # time [ms], rate [mg/ms]; or in the table of "
    f"masses, {RECORDING},{RATE},{NAMES} with healthy_60.csv,tube_60.txt,time [ms] rate [mg/ms]"
)


class WeighedMass(NamedTuple):
    """Mass of an injection, or mean of a recording's, and its standard deviation [kg]."""

    mass: float
    sigma: float

    def by(self, level: float) -> "WeighedMass":
        """The mass in units that are `level` times as large."""
        return WeighedMass(self.mass / level, self.sigma / level)


WeighedMasses = Mapping[int, WeighedMass]
"""Masses of a recording by the number of the injection, from 1; MEAN: the mean of all."""


def read_masses(path: Path, recordings: Sequence[Measurement], density: float) -> dict[int, dict[int, WeighedMass]]:
    """Measured masses by the number of the recording; density of the fuel [kg/m3]. Raises `UserError` with the line.

    CSV: `recording` (file name), perhaps `injection` (its number there, pilot and main as one; else it is the mean),
    `mass_mg` or `rate_file` (table of a rate meter whose integral that mass is, by its path from this file), perhaps
    `sigma_mg` or `sigma_percent` (else 0.5 %) and `names` (of the meter's columns, with units, where its table has
    none). Masses of injections that are not judged count for nothing.
    """
    masses: dict[int, dict[int, WeighedMass]] = {}
    for location, row in _rows(path):
        number = _recording(location, row[RECORDING], recordings)
        injection, others = _injection(location, row, recordings[number]), masses.setdefault(number, {})
        if injection in others or (others and MEAN in {injection, *others}):
            problem = f"another line has the mass of {row[RECORDING]}, or of one of its injections"
            raise UserError(location, problem, "give its mean once, or each injection once and no mean")
        others[injection] = _mass(location, row, path.parent, density)
    judged = [{MEAN, *(event.number for event in one.events)} for one in recordings]
    if not any(judged[number].intersection(of) for number, of in masses.items()):
        raise UserError(str(path), "holds no mass of an injection that is judged", _EXAMPLE)
    return masses


def _rows(path: Path) -> Iterator[tuple[str, dict[str, str]]]:
    """Rows of a table of masses that are not empty: file and line, and the cells by column."""
    with file_errors(path), path.open(encoding="utf-8-sig", newline="") as file:
        try:
            separator = max(",;\t", key=file.readline().count)
            file.seek(0)
            table = [[cell.strip() for cell in row] for row in csv.reader(file, delimiter=separator)]
        except (csv.Error, UnicodeDecodeError) as error:
            raise UserError(str(path), f"is no CSV: {error}", _EXAMPLE) from None
    above = int(table[:1] == [["sep=", ""]])  # Excel's line that names the separator
    header, *rows = table[above:] or [[]]
    layouts = ({RECORDING, MASS}, {RECORDING, RATE}, {RECORDING, RATE, NAMES})
    names = {*header}
    if names - {INJECTION, SIGMA, PERCENT} not in layouts or len(names) < len(header) or {SIGMA, PERCENT} <= names:
        raise UserError(f"{path}, line {above + 1}", f"has the columns '{', '.join(header)}'", _EXAMPLE)
    for line, cells in enumerate(rows, start=above + 2):
        location = f"{path}, line {line}"
        if any(cells) and len(cells) != len(header):
            raise UserError(location, f"has {len(cells)} cells, the header {len(header)}", _EXAMPLE)
        if any(cells):
            yield location, dict(zip(header, cells, strict=True))


def _recording(location: str, name: str, recordings: Sequence[Measurement]) -> int:
    paths = [measurement.recording.path for measurement in recordings]
    numbers = [n for n, path in enumerate(paths) if path is not None and name in (path.name, str(path))]
    if len(numbers) != 1:
        names = ", ".join(sorted({path.name for path in paths if path is not None}))
        problem = "is none of the recordings" if not numbers else "is the name of several recordings"
        raise UserError(location, f"'{name}' {problem}", f"name one as on the command line: {names}")
    return numbers[0]


def _injection(location: str, row: Mapping[str, str], recording: Measurement) -> int:
    """Number of a row's injection, or MEAN."""
    text, count = row.get(INJECTION), recording.injections.complete + len(recording.injections.left_out)
    if not text:
        return MEAN
    if text not in map(str, range(1, count + 1)):
        problem = f"'{text}' is no injection of {row[RECORDING]}, which has {count}"
        raise UserError(f"{location}, {INJECTION}", problem, f"give 1 to {count}, `event` of `evaluate`, or nothing")
    return int(text)


def _mass(location: str, row: Mapping[str, str], folder: Path, density: float) -> WeighedMass:
    """Mass of a row, or of the rate meter's table that it names by the path from a folder."""
    if MASS in row:
        mass = _number(f"{location}, {MASS}", row[MASS], LARGEST_MASS)
    else:
        mass = _mass_of_rate(folder / row[RATE], density, row.get(NAMES, "")) / MILLIGRAM
        _refuse_out_of_range(f"{location}, {RATE} {row[RATE]}", f"{mass:.12g}", mass, LARGEST_MASS)
    share = SHARE_SIGMA
    if text := row.get(PERCENT):
        share = 0.01 * _number(f"{location}, {PERCENT}", text, 100.0, "%")
    sigma = _number(f"{location}, {SIGMA}", text, mass) if (text := row.get(SIGMA)) else share * mass
    return WeighedMass(mass * MILLIGRAM, sigma * MILLIGRAM)


def _number(location: str, text: str, highest: float, unit: str = "mg") -> float:
    """The number in a cell. Raises `UserError` for another text, and out of range."""
    value = math.nan
    with suppress(ValueError):
        value = float(text.replace(",", "."))
    _refuse_out_of_range(location, text, value, highest, unit)
    return value


def _refuse_out_of_range(location: str, text: str, value: float, highest: float, unit: str = "mg") -> None:
    if not 0.0 < value <= highest:
        raise UserError(location, f"'{text}' is out of range", f"give {unit} above 0 and up to {highest:g}")


def _mass_of_rate(path: Path, density: float, names: str = "") -> float:
    """Mass [kg] that a rate meter's table holds, in any dialect, by the trapezoidal rule; density [kg/m3].

    Headings may stand behind #; names: instead of headings. Raises `UserError` for headings that do not say which
    column is which, in which unit, for two injections, and for a row, by its line, that is no measurement.
    """
    with file_errors(path):
        headings = [Heading(*name_and_unit(name)) for name in NAME_WITH_UNIT.findall(names)]
        location = f"{path}, {NAMES} '{names}'"
        if not names:
            dialect = dialect_of(path, None, fewest=2, remedy=_HEADED)
            headings, location = dialect.headings, f"{path}, line {dialect.heading}"
        choices = {signal: chosen(signal, headings) for signal in (TIME, INJECTION_RATE)}
        if problems := [f"{name}: {choice.problem}" for name, choice in choices.items() if choice.problem]:
            raise UserError(location, "; ".join(problems), _HEADED)
        columns = {
            name: TimeConfig(column=f"#{headings.index(choice.heading) + 1}", unit=choice.unit or None)
            for name, choice in choices.items()
            if choice.heading is not None
        }
        others = ("rail_pressure", "needle_lift", "line_pressure")  # which a meter has not
        layout = RecordingConfig.model_construct(None, **dict.fromkeys(others), **columns)
        dialect_of(path, layout, fewest=2, remedy=_HEADED)
        table = CsvTable(path, layout)
        parts = list(table.parts(0))
    time = np.concatenate([part.time for part in parts])
    rate = np.concatenate([part.signals[INJECTION_RATE] for part in parts])
    bad = np.flatnonzero(~np.isfinite(rate + time) | (np.diff(time, prepend=-np.inf) <= 0.0))
    if bad.size or time.size < 2:
        problem = "the time does not rise, or a value is missing" if bad.size else "holds one row only"
        location = table.location(int(bad[0]) if bad.size else 0, 0)
        raise UserError(location, problem, "give one row for each instant, in the order of time")
    unit = columns[INJECTION_RATE].unit or ""
    seconds = UNITS[TIME].get(columns[TIME].unit or "", 1.0)  # of a calendar
    flowing = time[rate > FLOWS * rate.max()] * seconds
    if pauses := np.count_nonzero(np.diff(flowing) > EVENT_GAP):
        problem = f"holds {pauses + 1} injections, the last at {flowing[-1]:.4g} s"
        raise UserError(str(path), problem, "give the rate of one, pilot and main as one, such as their mean")
    factor = seconds * UNITS[INJECTION_RATE][unit]
    return float(np.trapezoid(rate, time)) * factor * (1.0 if unit in MASS_RATE_UNITS else density)
