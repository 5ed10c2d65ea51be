"""The last injections over each other: pressures, lift, rate with its band, phi."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from observer_rt.watch.page.panel import (
    BAND,
    NOMINAL,
    OBSERVER,
    PAST,
    SECOND,
    THIRD,
    Axes,
    Axis,
    Columns,
    Mark,
    MarkKind,
    Panel,
    Scale,
)
from observer_rt.watch.results import SeenInjection, Signal

_OVERLAID = 8  # injections, the one shown included
_POINTS = 300  # of a curve, at the most: a screen shows no more
_TIME = "time from the beginning, ms"
_DETAILS = (  # the last: what the axis shows at least, so that noise looks like noise
    ("line_pressure", "Line pressure", "MPa", 20.0),
    ("rail_pressure", "Rail pressure", "MPa", 20.0),
    ("needle_lift", "Needle lift", "µm", 50.0),
)
_PHI = ("phi_1", "phi_2", "phi_3")
_GAP = np.full(1, np.nan, np.float32)


def rate_panel(name: str, injector: str) -> Panel:
    """The injection rate of one injector, nominal and estimated, over those of the injections before.

    injector: its name, empty for the only one.
    """
    marks = (
        _before("rate"),
        Mark(MarkKind.BAND, "time", ("low", "high"), BAND, alpha=0.6, label="95 %"),
        Mark(MarkKind.LINE, "time", ("nominal",), NOMINAL, 4.0, (6, 6), label="nominal"),
        Mark(MarkKind.LINE, "time", ("rate",), OBSERVER, 4.0, label="observer"),
    )
    scale = Axis(("past_rate", "rate", "nominal", "low", "high"), 10.0).limits
    axes = Axes(f"Injection rate {injector}".strip(), _TIME, "mm³/ms", _time(), scale, 310)
    return Panel(name, axes, marks, _rate_columns)


def detail_panels() -> list[Panel]:
    """What lies behind the rate: pressures, lift, the three rows of phi."""
    return [*(_detail_panel(*each) for each in _DETAILS), _phi_panel()]


def _detail_panel(name: str, title: str, unit: str, span: float) -> Panel:
    def columns(injections: Sequence[SeenInjection]) -> Columns:
        return _overlaid(injections, name)

    axes = Axes(title, _TIME, unit, _time(), Axis((f"past_{name}", name), span).limits)
    return Panel(name, axes, (_before(name), Mark(MarkKind.LINE, "time", (name,), OBSERVER, 3.0)), columns)


def _phi_panel() -> Panel:
    colours = zip(_PHI, (OBSERVER, SECOND, THIRD), strict=True)
    marks = [
        Mark(MarkKind.LINE, "time", (name,), colour, 3.0, label=name.replace("_", " "))
        for name, colour in colours
    ]
    axes = Axes("Correction phi", _TIME, "1/s", _time(), Axis(_PHI, 10.0).limits)
    return Panel("phi", axes, marks, _phi_columns)


def _before(name: str) -> Mark:
    return Mark(MarkKind.LINE, "past_time", (f"past_{name}",), PAST, 1.5, alpha=0.45)


def _time() -> Scale:
    return Axis(("past_time", "time"), 1.0, margin=0.0).limits


def _rate_columns(injections: Sequence[SeenInjection]) -> Columns:
    columns = _overlaid(injections, "rate", "nominal")
    if not columns:
        return {}
    rate, band = columns["rate"], _thinned(_with_curves(injections)[-1].band)
    return {**columns, "low": rate - band, "high": rate + band}


def _phi_columns(injections: Sequence[SeenInjection]) -> Columns:
    columns = _overlaid(injections)
    if not columns:
        return {}
    rows = _with_curves(injections)[-1].curves.phi
    return {**columns, **{name: _thinned(row) for name, row in zip(_PHI, rows, strict=True)}}


def _overlaid(injections: Sequence[SeenInjection], *names: str) -> dict[str, Signal]:
    """Time and signals of the injection that counts, time and the first of the signals of those before it."""
    drawn = _with_curves(injections)
    if not drawn:
        return {}
    *before, last = (each.curves for each in drawn)
    shown = {name: _thinned(getattr(last, name)) for name in ("time", *names)}
    past = {
        f"past_{name}": _in_one([getattr(each, name) for each in before]) for name in ("time", *names[:1])
    }
    return shown | past


def _with_curves(injections: Sequence[SeenInjection]) -> list[SeenInjection]:
    return [each for each in injections[-_OVERLAID:] if each.curves.time.size]


def _in_one(curves: Sequence[Signal]) -> Signal:
    """One curve after the other, with gaps."""
    parts = [part for each in curves for part in (_thinned(each), _GAP)]
    return np.concatenate([_GAP, *parts])


def _thinned(values: Signal) -> Signal:
    step = max(1, -(-values.size // _POINTS))
    thinned: NDArray[np.float32] = values[::step].copy()
    return thinned
