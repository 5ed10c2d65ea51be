"""Measured masses of injections: read from a table, known to a share, in other units."""

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_errors
from observer_rt.foundation.units import MILLIGRAM
from observer_rt.identification.likelihood.measurement import Measurement

RECORDING, INJECTION, MASS, SIGMA = "recording", "injection", "mass_mg", "sigma_mg"
SHARE_SIGMA = 0.005  # of a mass whose uncertainty is not stated: a good injection analyser
LARGEST_MASS = 2000.0  # mg
_EXAMPLE = f"{RECORDING},{MASS} with lines such as healthy_60.csv,31.4"


@dataclass(frozen=True)
class MeasuredMasses:
    """Measured masses of a recording's injections [kg], each with its standard deviation.

    single: by the first sample of the injection; mean: of all injections, None where they were not weighed together.
    """

    single: Mapping[int, tuple[float, float]]
    mean: tuple[float, float] | None = None


def read_masses(path: Path, recordings: Sequence[Measurement]) -> dict[int, MeasuredMasses]:
    """Measured masses by the number of the recording.

    CSV: `recording` (file name), `mass_mg`, and, where there are such columns, `injection` (number in the recording
    from 1, pilot and main as one; empty: the mean of all) and `sigma_mg` (standard deviation, else 0.5 %).
    Raises `UserError` naming the line.
    """
    with file_errors(path), path.open(encoding="utf-8-sig", newline="") as file:
        try:
            rows = list(csv.reader(file))
        except (csv.Error, UnicodeDecodeError) as error:
            raise UserError(str(path), f"is no CSV: {error}", f"write {_EXAMPLE}") from None
    if not rows:
        raise UserError(str(path), "is empty", f"write {_EXAMPLE}")
    header = [name.strip() for name in rows[0]]
    _check_header(f"{path}, line 1", header)
    single: dict[int, dict[int, tuple[float, float]]] = {}
    means: dict[int, tuple[float, float]] = {}
    for line, cells in enumerate(rows[1:], start=2):
        if not any(cell.strip() for cell in cells):
            continue
        location = f"{path}, line {line}"
        if len(cells) != len(header):
            raise UserError(
                location, f"has {len(cells)} cells, the header {len(header)}", "give every column a value"
            )
        row = {name: cell.strip() for name, cell in zip(header, cells, strict=True)}
        number = _recording(location, row[RECORDING], recordings)
        mass = _mass(location, row)
        first = _first_sample(location, row.get(INJECTION, ""), recordings[number])
        masses_by_injection = means if first is None else single.setdefault(number, {})
        key = number if first is None else first
        if key in masses_by_injection:
            raise UserError(
                location, f"another line has the mass of {row[RECORDING]}, too", "give every mass once"
            )
        masses_by_injection[key] = mass
    numbers = sorted(single.keys() | means.keys())
    if not numbers:
        raise UserError(str(path), "holds no mass", f"write {_EXAMPLE}")
    return {number: MeasuredMasses(single.get(number, {}), means.get(number)) for number in numbers}


def _check_header(location: str, header: Sequence[str]) -> None:
    allowed = (RECORDING, INJECTION, MASS, SIGMA)
    for name in (RECORDING, MASS):
        if name not in header:
            raise UserError(location, f"has no column {name}", f"known columns: {', '.join(allowed)}")
    for name in header:
        if name not in allowed or header.count(name) > 1:
            problem = "is given twice" if name in allowed else "is unknown"
            raise UserError(location, f"column '{name}' {problem}", f"known columns: {', '.join(allowed)}")


def _recording(location: str, name: str, recordings: Sequence[Measurement]) -> int:
    paths = [one.recording.path for one in recordings]
    numbers = [n for n, path in enumerate(paths) if path is not None and name in (path.name, str(path))]
    if len(numbers) != 1:
        names = ", ".join(sorted({path.name for path in paths if path is not None}))
        problem = "is none of the recordings" if not numbers else "is the name of several recordings"
        raise UserError(location, f"'{name}' {problem}", f"name one as on the command line: {names}")
    return numbers[0]


def _mass(location: str, row: Mapping[str, str]) -> tuple[float, float]:
    """Mass and standard deviation [kg]."""
    mass = _number(f"{location}, {MASS}", row[MASS], LARGEST_MASS)
    stated = row.get(SIGMA, "")
    sigma = _number(f"{location}, {SIGMA}", stated, mass) if stated else SHARE_SIGMA * mass
    return mass * MILLIGRAM, sigma * MILLIGRAM


def _number(location: str, text: str, highest: float) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value <= highest:
        raise UserError(location, f"'{text}' is out of range", f"give mg above 0 and up to {highest:g}")
    return value


def _first_sample(location: str, text: str, measurement: Measurement) -> int | None:
    """First sample of the injection of this number; None for the mean of all."""
    if not text:
        return None
    time = measurement.recording.time
    left_out = np.searchsorted(time, [injection.time for injection in measurement.injections.left_out])
    firsts = sorted([event.openings[0].first for event in measurement.events] + left_out.tolist())
    try:
        number = int(text)
    except ValueError:
        number = 0
    if not 1 <= number <= len(firsts):
        raise UserError(
            f"{location}, {INJECTION}", f"'{text}' is none of them", f"give 1 to {len(firsts)}, or nothing"
        )
    return int(firsts[number - 1])


def masses_without(weighed: Mapping[int, MeasuredMasses], level: float) -> dict[int, MeasuredMasses]:
    """Measured masses in the same units."""

    def of(mass: tuple[float, float]) -> tuple[float, float]:
        return mass[0] / level, mass[1] / level

    return {
        number: MeasuredMasses(
            {first: of(mass) for first, mass in one.single.items()},
            None if one.mean is None else of(one.mean),
        )
        for number, one in weighed.items()
    }


def own_accuracy(weighed: Sequence[MeasuredMasses]) -> float:
    """Share by which measured masses are known, all of them alike: what one of them is."""
    masses = [mass for one in weighed for mass in (*one.single.values(), one.mean) if mass is not None]
    return float(np.median([sigma / mass for mass, sigma in masses])) if masses else math.nan
