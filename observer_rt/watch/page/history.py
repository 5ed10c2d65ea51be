"""Mass of every injection and the wear over them, with what is sure of each."""

from collections.abc import Callable, Sequence

import numpy as np

from observer_rt.watch.page.panel import (
    NOMINAL,
    NOT_VALID,
    OBSERVER,
    SECOND,
    Axes,
    Axis,
    Columns,
    Limits,
    Mark,
    MarkKind,
    Panel,
)
from observer_rt.watch.results import SeenInjection, Signal

_SURE = 1.96  # standard deviations of a 95 % interval
_WEAR = (("nozzle", OBSERVER), ("seat", SECOND))
_STEP = 100  # injections by which the axis moves
_LEAST_MASS, _LEAST_WEAR = 1.0, 2.0  # mg, %: that axes show


def history_panels() -> list[Panel]:
    """What became of one injector."""
    return [_mass_panel(), _wear_panel()]


def _mass_panel() -> Panel:
    marks = (
        Mark(MarkKind.BARS, "number", ("valid_low", "valid_high"), OBSERVER, alpha=0.5),
        Mark(MarkKind.BARS, "number", ("refused_low", "refused_high"), NOT_VALID, alpha=0.5),
        Mark(MarkKind.DASHES, "number", ("nominal",), NOMINAL, label="nominal"),
        Mark(MarkKind.DOTS, "number", ("valid",), OBSERVER, label="observer"),
        Mark(MarkKind.DOTS, "number", ("refused",), NOT_VALID, label="not valid"),
    )
    scale = Axis(("nominal", "valid_low", "valid_high", "refused_low", "refused_high"), _LEAST_MASS).limits
    axes = Axes("Mass of each injection", "injection", "mg", _numbers, scale)
    return Panel("mass", axes, marks, _mass_columns())


def _wear_panel() -> Panel:
    marks = [
        mark
        for name, colour in _WEAR
        for mark in (
            Mark(MarkKind.BAND, "number", (f"{name}_low", f"{name}_high"), colour, alpha=0.2),
            Mark(MarkKind.LINE, "number", (name,), colour, 3.0, label=name),
        )
    ]
    shown = [f"{name}_{end}" for name, _ in _WEAR for end in ("low", "high")]
    axes = Axes("Wear", "injection", "% of flow", _numbers, Axis(shown, _LEAST_WEAR).limits)
    return Panel("wear", axes, marks, _wear_columns())


class _Remembered:
    """Numbers of injections, of which each is read but once."""

    def __init__(self, row: Callable[[SeenInjection], Sequence[float]]) -> None:
        self._row = row
        self._rows = np.empty((0, 0), np.float32)
        self._last: SeenInjection | None = None

    def columns(self, injections: Sequence[SeenInjection]) -> Signal:
        """A row of every number, of all injections."""
        new = 0
        while new < len(injections) and injections[-1 - new] is not self._last:
            new += 1
        rows = np.array([self._row(each) for each in injections[len(injections) - new :]], np.float32)
        if 0 < new < len(injections):
            rows = np.concatenate([self._rows, rows])[-len(injections) :]
        self._rows, self._last = (rows if new else self._rows), injections[-1]
        return np.ascontiguousarray(self._rows.T)


def _mass_row(seen: SeenInjection) -> Sequence[float]:
    said = seen.summary
    return said.injection_number, seen.nominal_mass, said.mass, said.mass_sigma, said.valid


def _mass_columns() -> Callable[[Sequence[SeenInjection]], Columns]:
    remembered = _Remembered(_mass_row)

    def columns(injections: Sequence[SeenInjection]) -> Columns:
        number, nominal, mass, sigma, valid = remembered.columns(injections)
        is_valid = valid == 1.0
        return {
            "number": number,
            "nominal": nominal,
            **_banded("valid", np.where(is_valid, mass, np.nan), sigma),
            **_banded("refused", np.where(is_valid, np.nan, mass), sigma),
        }

    return columns


def _wear_row(seen: SeenInjection) -> Sequence[float]:
    said = seen.summary
    nozzle, seat = (said.nozzle_wear, said.nozzle_wear_sigma), (said.seat_wear, said.seat_wear_sigma)
    return said.injection_number, *(100.0 * each for each in (*nozzle, *seat))


def _wear_columns() -> Callable[[Sequence[SeenInjection]], Columns]:
    remembered = _Remembered(_wear_row)

    def columns(injections: Sequence[SeenInjection]) -> Columns:
        number, nozzle, nozzle_sigma, seat, seat_sigma = remembered.columns(injections)
        return {
            "number": number,
            **_banded("nozzle", nozzle, nozzle_sigma),
            **_banded("seat", seat, seat_sigma),
        }

    return columns


def _banded(name: str, mean: Signal, sigma: Signal) -> dict[str, Signal]:
    beside = np.float32(_SURE) * sigma
    return {name: mean, f"{name}_low": mean - beside, f"{name}_high": mean + beside}


def _numbers(columns: Columns) -> Limits:
    """Round ends around the injections."""
    known = columns["number"][np.isfinite(columns["number"])]
    if not known.size:
        return 0.0, float(_STEP)
    return float(known.min() // _STEP * _STEP), float((known.max() // _STEP + 1) * _STEP)
