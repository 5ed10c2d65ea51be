"""A map of masses, read from a table of rail pressures, energizing times, masses or volumes in any dialect of CSV."""

import csv
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from observer_rt.files.signals.csv_dialect import COMMENT, Dialect, dialect_of
from observer_rt.files.signals.naming import unit_ending
from observer_rt.foundation.errors import UserError, file_errors
from observer_rt.foundation.units import CUBIC_MILLIMETRE, MASS_UNITS, PRESSURE_UNITS, TIME_UNITS, Floats, spelled

SHARE_SIGMA = 0.02  # of a mass whose uncertainty the table does not state, ..
LEAST_SIGMA = 0.1e-6  # kg, .. and this beside it
LEAST_DENSITY = 500.0  # kg/m3, of a fuel, by which the largest volume follows from the largest mass
SIGMAS_IN_TOLERANCE = 2.0  # standard deviations in a tolerance of a test plan
_VOLUMES = {"mm3": CUBIC_MILLIMETRE, "ul": CUBIC_MILLIMETRE, "cm3": 1e-6, "ml": 1e-6}  # m3
_MASSES = {**MASS_UNITS, **_VOLUMES}
_SHARES = {"%": 0.01, "percent": 0.01}
_PER_STROKE = re.compile(r"[ _]*(?:/|per)?[ _]*(?:stroke|shot|hub|str|inj(?:ection)?)\.?$", re.IGNORECASE)
_EXAMPLE = "write rail_pressure_MPa,energizing_ms,mass_mg[,sigma_mg][,back_pressure_MPa] with lines like 60,0.6,21.4"


class _Column(NamedTuple):
    """A column of a map: pattern of its names in small letters, its units, and the largest value [SI]."""

    pattern: str
    units: Mapping[str, float]
    largest: float


_COLUMNS = {  # the first whose pattern a name matches
    "sigma": _Column(r"sigma|std|uncert|toler|abweich", {**_MASSES, **_SHARES}, math.inf),
    "back_pressure": _Column(r"back_?pres|back p|chamber|gegen|counter", PRESSURE_UNITS, 50e6),
    "energizing": _Column(r"energi|\bet\b|durat|pulse|dauer|time|zeit", TIME_UNITS, 0.1),
    "rail_pressure": _Column(r"rail|press|druck|\bp\b", PRESSURE_UNITS, 400e6),
    "mass": _Column(r"mass|quantit|menge|deliver|volum|fuel|inject", _MASSES, 2e-3),
}
NEEDED = ("rail_pressure", "energizing", "mass")


@dataclass(frozen=True, eq=False)
class MassMap:
    """Masses of an injector by operating point, SI; arrays are (n,)."""

    rail_pressure: Floats
    energizing: Floats  # s
    mass: Floats  # kg
    sigma: Floats  # kg, standard deviation of each
    back_pressure: float | None = None  # Pa; None: not stated


def read_map(path: Path, density: float, fewest: int = 1) -> MassMap:
    """A map of `fewest` points or more; density [kg/m3]: for volumes. Raises `UserError` naming the line."""
    with file_errors(path):
        dialect = dialect_of(path, None, fewest=len(NEEDED), remedy=_EXAMPLE)
        columns = _columns(f"{path}, line {dialect.heading}", dialect)
        rows = [*_rows(path, dialect, columns)]
    if len(rows) < fewest:
        raise UserError(str(path), f"holds {len(rows)} points", f"give {fewest} or more, of several durations")
    values = {name: np.array([row[name] for row in rows]) for name in columns}
    mass = values["mass"] * (density if columns["mass"].is_volume else 1.0)
    if not mass.any():
        raise UserError(str(path), "holds no mass above 0", _EXAMPLE)
    sigma = np.hypot(SHARE_SIGMA * mass, LEAST_SIGMA)
    if (stated := columns.get("sigma")) is not None:
        factor = mass if stated.is_share else density if stated.is_volume else 1.0
        sigma = values["sigma"] * factor / (SIGMAS_IN_TOLERANCE if stated.is_tolerance else 1.0)
        sigma = np.maximum(sigma, 1e-3 * LEAST_SIGMA)
    return MassMap(values["rail_pressure"], values["energizing"], mass, sigma, _back_pressure(path, values))


class _Place(NamedTuple):
    """Place of a column in the table, and the unit of its numbers."""

    number: int
    unit: str
    heading: str

    @property
    def is_volume(self) -> bool:
        return self.unit in _VOLUMES

    @property
    def is_share(self) -> bool:
        return self.unit in _SHARES

    @property
    def is_tolerance(self) -> bool:
        return re.search("toler|abweich", self.heading.lower()) is not None


def _columns(location: str, dialect: Dialect) -> dict[str, _Place]:
    """Places of the map's columns by name. Raises `UserError` where names and units do not tell them apart."""
    named: dict[str, list[_Place]] = {}
    for number, heading in enumerate(dialect.headings):
        words = re.sub(r"[_\W]+", " ", heading.name.lower())
        name = next((name for name, column in _COLUMNS.items() if re.search(column.pattern, words)), None)
        if name is not None:
            unit = _unit(heading.name, heading.unit, _COLUMNS[name].units)
            named.setdefault(name, []).append(_Place(number, unit, heading.name))
    if missing := [name for name in NEEDED if name not in named]:
        raise UserError(location, f"no heading names {', '.join(missing)}", _EXAMPLE)
    columns = {}
    for name, places in named.items():
        with_unit = [place for place in places if place.unit]
        if len(with_unit) == 1:
            columns[name] = with_unit[0]
        elif with_unit or name in NEEDED:
            headings = " and ".join(f"'{place.heading}'" for place in with_unit or places)
            problem = f"{headings}: several could be the {name}" if with_unit else f"{headings}: no unit of a {name}"
            raise UserError(location, problem, f"units are {', '.join(_COLUMNS[name].units)}; {_EXAMPLE}")
    return columns


def _unit(name: str, stated: str, units: Mapping[str, float]) -> str:
    """Unit that a heading states, or that ends its name, as in `mass_mg`; empty without one."""
    if stated:
        return spelled(_PER_STROKE.sub("", stated), units)
    return unit_ending(_PER_STROKE.sub("", name), lambda end: spelled(end, units))


def _rows(path: Path, dialect: Dialect, columns: Mapping[str, _Place]) -> Iterator[dict[str, float]]:
    """Rows in the units of SI, or in shares."""
    with path.open(encoding=dialect.encoding, newline="") as file:
        lines = enumerate(islice(file, dialect.first_row, None), start=dialect.first_row + 1)
        for number, line in lines:
            cells = next(csv.reader([line.strip()], delimiter=dialect.separator, skipinitialspace=True), [])
            if any(cell.strip() for cell in cells) and not line.lstrip().startswith(COMMENT):
                yield _row(f"{path}, line {number}", cells, dialect.decimal, columns)


def _row(location: str, cells: Sequence[str], decimal: str, columns: Mapping[str, _Place]) -> dict[str, float]:
    row = {}
    for name, column in columns.items():
        text = cells[column.number].strip() if column.number < len(cells) else ""
        value = math.nan
        with suppress(ValueError):
            value = float(text.replace(decimal, ".")) * _COLUMNS[name].units[column.unit]
        largest = _COLUMNS[name].largest / (LEAST_DENSITY if column.is_volume else 1.0)
        if not 0.0 <= value <= largest or (value == 0.0 and name in ("rail_pressure", "energizing")):
            problem = f"'{text}' {column.unit} in '{column.heading}' is no {name.replace('_', ' ')}"
            raise UserError(location, problem, f"give a number of the right unit in every row; {_EXAMPLE}")
        row[name] = value
    return row


def _back_pressure(path: Path, values: Mapping[str, Floats]) -> float | None:
    stated = values.get("back_pressure")
    if stated is None:
        return None
    if np.ptp(stated) > 0.0:
        raise UserError(str(path), "has several back pressures", "give a map for each of them")
    return float(stated[0])
