"""Measured injection masses, as a table beside the recordings."""

import csv
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from observer_rt.evidence.measurement import Measurement
from observer_rt.fit.parts import Weighed
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_errors
from observer_rt.foundation.units import MILLIGRAM

RECORDING, INJECTION, MASS, SIGMA = "recording", "injection", "mass_mg", "sigma_mg"
SHARE_SIGMA = 0.005  # of a mass whose uncertainty is not stated: a good injection analyser
LARGEST_MASS = 2000.0  # mg
_EXAMPLE = f"{RECORDING},{MASS} with lines such as healthy_60.csv,31.4"


def read_masses(path: Path, found: Sequence[Measurement]) -> dict[int, Weighed]:
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
        place = f"{path}, line {line}"
        if len(cells) != len(header):
            raise UserError(
                place, f"has {len(cells)} cells, the header {len(header)}", "give every column a value"
            )
        row = {name: cell.strip() for name, cell in zip(header, cells, strict=True)}
        number = _recording(place, row[RECORDING], found)
        mass = _mass(place, row)
        first = _first_sample(place, row.get(INJECTION, ""), found[number])
        known = means if first is None else single.setdefault(number, {})
        key = number if first is None else first
        if key in known:
            raise UserError(
                place, f"another line has the mass of {row[RECORDING]}, too", "give every mass once"
            )
        known[key] = mass
    numbers = sorted(single.keys() | means.keys())
    if not numbers:
        raise UserError(str(path), "holds no mass", f"write {_EXAMPLE}")
    return {number: Weighed(single.get(number, {}), means.get(number)) for number in numbers}


def _check_header(place: str, header: Sequence[str]) -> None:
    known = (RECORDING, INJECTION, MASS, SIGMA)
    for name in (RECORDING, MASS):
        if name not in header:
            raise UserError(place, f"has no column {name}", f"known columns: {', '.join(known)}")
    for name in header:
        if name not in known or header.count(name) > 1:
            problem = "is given twice" if name in known else "is unknown"
            raise UserError(place, f"column '{name}' {problem}", f"known columns: {', '.join(known)}")


def _recording(place: str, name: str, found: Sequence[Measurement]) -> int:
    paths = [one.recording.path for one in found]
    numbers = [n for n, path in enumerate(paths) if path is not None and name in (path.name, str(path))]
    if len(numbers) != 1:
        given = ", ".join(sorted({path.name for path in paths if path is not None}))
        problem = "is none of the recordings" if not numbers else "is the name of several recordings"
        raise UserError(place, f"'{name}' {problem}", f"name one as on the command line: {given}")
    return numbers[0]


def _mass(place: str, row: Mapping[str, str]) -> tuple[float, float]:
    """Mass and standard deviation [kg]."""
    mass = _number(f"{place}, {MASS}", row[MASS], LARGEST_MASS)
    stated = row.get(SIGMA, "")
    sigma = _number(f"{place}, {SIGMA}", stated, mass) if stated else SHARE_SIGMA * mass
    return mass * MILLIGRAM, sigma * MILLIGRAM


def _number(place: str, text: str, highest: float) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value <= highest:
        raise UserError(place, f"'{text}' is out of range", f"give mg above 0 and up to {highest:g}")
    return value


def _first_sample(place: str, text: str, one: Measurement) -> int | None:
    """First sample of the injection of this number; None for the mean of all."""
    if not text:
        return None
    time = one.recording.time
    left_out = np.searchsorted(time, [injection.time for injection in one.found.left_out])
    firsts = sorted([event.openings[0].first for event in one.events] + left_out.tolist())
    try:
        number = int(text)
    except ValueError:
        number = 0
    if not 1 <= number <= len(firsts):
        raise UserError(
            f"{place}, {INJECTION}", f"'{text}' is none of them", f"give 1 to {len(firsts)}, or nothing"
        )
    return int(firsts[number - 1])
