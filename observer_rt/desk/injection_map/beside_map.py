"""Injections beside the points of a map, such as a test plan: mass, tolerance, inside or outside.

An injection belongs to the nearest point within `NEAR`; the model carries its mass there by a ratio.
"""

from collections.abc import Iterable
from typing import Literal, NamedTuple

import numpy as np
from rich.console import Console

from observer_rt.desk.injection_map.mass_map import MassMap
from observer_rt.desk.injection_map.simulated_masses import masses_of
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.foundation.console import plain_table, say
from observer_rt.foundation.documents import DocumentPart
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MILLISECOND, Z_95, Bools, Floats
from observer_rt.model.parameters import InjectorParameters

NEAR = 0.05  # share by which rail pressure and energizing time may be off a point
SHORT = 20e-6  # s, by which the energizing time may be off in any case


class ComparedPoint(DocumentPart):
    """A point of the map and its valid injections; open: their interval reaches across an end of the tolerance."""

    rail_pressure_MPa: float  # noqa: N815 - units as printed
    energizing_ms: float
    stated_mg: float
    tolerance_mg: float
    injections: int
    mass_mg: float | None = None
    mass_bound_mg: float | None = None
    verdict: Literal["inside", "outside", "open"] | None = None


class _Shots(NamedTuple):
    """Valid injections whose command is known; arrays are (n,), SI."""

    rail_pressure: Floats
    energizing: Floats
    mass: Floats
    bound: Floats


def beside_map(
    of: MassMap, injections: Iterable[InjectionReport], injector: InjectorParameters
) -> tuple[ComparedPoint, ...]:
    """Compare injections with a map, point by point in its order."""
    shots = _shots(injections)
    points = np.array([_nearest(of, *pair) for pair in zip(shots.rail_pressure, shots.energizing, strict=True)], int)
    return tuple(_compared(of, number, shots, points == number, injector) for number in range(of.mass.size))


def _shots(injections: Iterable[InjectionReport]) -> _Shots:
    rows = [
        (result.rail_pressure, result.commanded.energizing_time, result.mass, result.mass_bound)
        for result in injections
        if result.valid and result.commanded is not None
    ]
    return _Shots(*np.array(rows, np.float64).reshape(-1, len(_Shots._fields)).T)


def _nearest(of: MassMap, rail_pressure: float, energizing: float) -> int:
    """Number of the point to which an injection belongs; -1: to none."""
    by_pressure = np.abs(rail_pressure / of.rail_pressure - 1.0) / NEAR
    by_duration = np.abs(energizing - of.energizing) / np.maximum(NEAR * of.energizing, SHORT)
    away = np.maximum(by_pressure, by_duration)
    return int(np.argmin(away)) if away.min() <= 1.0 else -1


def _compared(of: MassMap, number: int, shots: _Shots, at: Bools, injector: InjectorParameters) -> ComparedPoint:
    """A point of the map beside the injections (n,) that are at it."""
    pressure, duration, stated = of.rail_pressure[number], of.energizing[number], of.mass[number] / MILLIGRAM
    tolerance, count = Z_95 * of.sigma[number] / MILLIGRAM, int(at.sum())
    figures = {"rail_pressure_MPa": pressure / MEGAPASCAL, "energizing_ms": duration / MILLISECOND}
    point = ComparedPoint(stated_mg=stated, tolerance_mg=tolerance, injections=count, **figures)
    if count == 0:
        return point
    pressures, durations = np.append(shots.rail_pressure[at], pressure), np.append(shots.energizing[at], duration)
    *elsewhere, here = masses_of(injector, pressures, durations)
    ratios = here / np.array(elsewhere) if min(elsewhere) > 0.0 else np.ones(len(elsewhere))
    mass, bound = (float(np.mean(ratios * values[at])) / MILLIGRAM for values in (shots.mass, shots.bound))
    beyond = abs(mass - stated) - tolerance
    verdict = "open" if abs(beyond) <= bound else "inside" if beyond < 0.0 else "outside"
    return point.model_copy(update={"mass_mg": mass, "mass_bound_mg": bound, "verdict": verdict})


def print_beside_map(points: tuple[ComparedPoint, ...], console: Console) -> None:
    """Print a table of the points, and how many have no valid injection."""
    rows = [
        (
            f"{point.rail_pressure_MPa:g}",
            f"{point.energizing_ms:g}",
            f"{point.stated_mg:.2f}",
            f"{point.tolerance_mg:.2f}",
            str(point.injections),
            *("-" if value is None else f"{value:.2f}" for value in (point.mass_mg, point.mass_bound_mg)),
            point.verdict or "-",
        )
        for point in points
    ]
    names = ("MPa", "ms", "stated mg", "±", "injections", "mass mg", "± 95 %", "verdict")
    say(console, "beside the map")
    console.print(plain_table(names, rows, right=range(7), folds=()))
    if missing := sum(point.injections == 0 for point in points):
        say(console, f"{missing} of {len(points)} points have no valid injection whose command is recorded")
