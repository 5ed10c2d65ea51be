"""Mass of every injection and the wear over them, with what is sure of each."""

from collections.abc import Sequence

import numpy as np

from observer_rt.watch.injection import SeenInjection, Signal
from observer_rt.watch.page.limits import Axis, Limits
from observer_rt.watch.page.look import NOMINAL, NOT_VALID, OBSERVER, SECOND
from observer_rt.watch.page.panel import Axes, Columns, Kind, Mark, Panel

_SURE = 1.96  # standard deviations of a 95 % interval
_WEAR = (("nozzle", OBSERVER), ("seat", SECOND))
_STEP = 100  # injections by which the axis moves
_LEAST_MASS, _LEAST_WEAR = 1.0, 2.0  # mg, %: that axes show


def history_panels() -> list[Panel]:
    """What became of one injector."""
    return [_mass_panel(), _wear_panel()]


def _mass_panel() -> Panel:
    marks = (
        Mark(Kind.BARS, "number", ("valid_low", "valid_high"), OBSERVER, alpha=0.5),
        Mark(Kind.BARS, "number", ("refused_low", "refused_high"), NOT_VALID, alpha=0.5),
        Mark(Kind.DASHES, "number", ("nominal",), NOMINAL, label="nominal"),
        Mark(Kind.DOTS, "number", ("valid",), OBSERVER, label="observer"),
        Mark(Kind.DOTS, "number", ("refused",), NOT_VALID, label="not valid"),
    )
    scale = Axis(("nominal", "valid_low", "valid_high", "refused_low", "refused_high"), _LEAST_MASS).limits
    axes = Axes("Mass of each injection", "injection", "mg", _numbers, scale)
    return Panel("mass", axes, marks, _mass_columns)


def _wear_panel() -> Panel:
    marks = [
        mark
        for name, colour in _WEAR
        for mark in (
            Mark(Kind.BAND, "number", (f"{name}_low", f"{name}_high"), colour, alpha=0.2),
            Mark(Kind.LINE, "number", (name,), colour, 3.0, label=name),
        )
    ]
    shown = [f"{name}_{end}" for name, _ in _WEAR for end in ("low", "high")]
    axes = Axes("Wear", "injection", "% of flow", _numbers, Axis(shown, _LEAST_WEAR).limits)
    return Panel("wear", axes, marks, _wear_columns)


def _mass_columns(injections: Sequence[SeenInjection]) -> Columns:
    said = [each.summary for each in injections]
    masses = _signal([(each.mass, each.mass_sigma) for each in said]).reshape(-1, 2)
    is_valid = np.array([each.valid == 1.0 for each in said])[:, None]
    return {
        "number": _signal([each.injection_number for each in said]),
        "nominal": _signal([each.nominal_mass for each in injections]),
        **_banded("valid", np.where(is_valid, masses, np.nan)),
        **_banded("refused", np.where(is_valid, np.nan, masses)),
    }


def _wear_columns(injections: Sequence[SeenInjection]) -> Columns:
    said = [each.summary for each in injections]
    nozzle = _signal([(each.nozzle_wear, each.nozzle_wear_sigma) for each in said])
    seat = _signal([(each.seat_wear, each.seat_wear_sigma) for each in said])
    number = _signal([each.injection_number for each in said])
    return {"number": number, **_banded("nozzle", 100.0 * nozzle), **_banded("seat", 100.0 * seat)}


def _signal(values: Sequence[float] | Sequence[tuple[float, float]]) -> Signal:
    return np.array(values, np.float32)


def _banded(name: str, values: Signal) -> dict[str, Signal]:
    """values (n, 2): mean and standard deviation."""
    mean, sigma = values.T
    return {
        name: mean.copy(),
        f"{name}_low": mean - np.float32(_SURE) * sigma,
        f"{name}_high": mean + np.float32(_SURE) * sigma,
    }


def _numbers(columns: Columns) -> Limits:
    """Round ends around the injections."""
    known = columns["number"][np.isfinite(columns["number"])]
    if not known.size:
        return 0.0, float(_STEP)
    return float(known.min() // _STEP * _STEP), float((known.max() // _STEP + 1) * _STEP)
