"""The last injections over each other: pressures, lift, rate with its band, phi."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from bokeh.models import ColumnDataSource
from bokeh.plotting import figure
from numpy.typing import NDArray

from observer_rt.watch.injection import SeenInjection, Signal
from observer_rt.watch.page.drawing import Limits, Parts, Target
from observer_rt.watch.page.limits import Axis
from observer_rt.watch.page.look import BAND, NOMINAL, OBSERVER, PAST, SECOND, THIRD, panel, with_legend

_OVERLAID = 8  # injections, the one shown included
_POINTS = 300  # of a curve, at the most: a screen shows no more
Signals = dict[str, Signal]
_TIME = "time from the beginning, ms"
_DETAILS = (  # the last: what the axis shows at least, so that noise looks like noise
    ("line_pressure", "Line pressure", "MPa", 20.0),
    ("rail_pressure", "Rail pressure", "MPa", 20.0),
    ("needle_lift", "Needle lift", "µm", 50.0),
)
_NAMES = tuple(name for name, *_ in _DETAILS)
_PHI = tuple(f"phi_{row}" for row in (1, 2, 3))
_GAP = np.full(1, np.nan, np.float32)


class RatePanel:
    """The injection rate of one injector, nominal and estimated, over those of the injections before."""

    def __init__(self, name: str, injector: str) -> None:
        """name: of its parts; injector: its name, empty for the only one."""
        self.figure = panel(f"Injection rate {injector}".strip(), _TIME, "mm³/ms", 340)
        drawn = ("rate", "nominal", "low", "high")
        self._overlay = _Overlay(name, ("rate",), drawn, {"rate": Axis(drawn, 10.0)})
        past, shown = self._overlay.past, self._overlay.shown
        self._overlay.scale(self.figure, "rate")
        _before(self.figure, "rate", past)
        self.figure.varea("time", "low", "high", source=shown, color=BAND, alpha=0.6, legend_label="95 %")
        for column, colour, dash, label in (
            ("nominal", NOMINAL, "dashed", "nominal"),
            ("rate", OBSERVER, "solid", "observer"),
        ):
            self.figure.line(
                "time",
                column,
                source=shown,
                color=colour,
                line_width=4,
                line_dash=dash,
                legend_label=label,
            )
        with_legend(self.figure)

    @property
    def targets(self) -> dict[str, Target]:
        """What its parts belong to."""
        return self._overlay.targets

    def parts(self, injections: Sequence[SeenInjection]) -> Parts:
        """Some injections, the last of them as the one that counts."""
        return self._overlay.parts(injections, _rates)


class DetailPanels:
    """What lies behind the rate: pressures, lift, the three rows of phi."""

    def __init__(self) -> None:
        axes = {name: Axis((name,), span) for name, _, _, span in _DETAILS} | {"phi": Axis(_PHI, 10.0)}
        self._overlay = _Overlay("details", _NAMES, (*_NAMES, *_PHI), axes)
        self.figures: dict[str, figure] = {}
        for name, title, unit, _ in _DETAILS:
            made = self.figures[name] = panel(title, _TIME, unit)
            self._overlay.scale(made, name)
            _before(made, name, self._overlay.past)
            made.line("time", name, source=self._overlay.shown, color=OBSERVER, line_width=3)
        phi = self.figures["phi"] = panel("Correction phi", _TIME, "1/s")
        self._overlay.scale(phi, "phi")
        for name, colour in zip(_PHI, (OBSERVER, SECOND, THIRD), strict=True):
            phi.line(
                "time",
                name,
                source=self._overlay.shown,
                color=colour,
                line_width=3,
                legend_label=name.replace("_", " "),
            )
        with_legend(phi)

    @property
    def targets(self) -> dict[str, Target]:
        """What its parts belong to."""
        return self._overlay.targets

    def parts(self, injections: Sequence[SeenInjection]) -> Parts:
        """Some injections, the last of them as the one that counts."""
        return self._overlay.parts(injections, _details)


class _Overlay:
    """The injection that counts, and those before it as one line with gaps: a part is sent and drawn at once."""

    def __init__(
        self, name: str, before: Sequence[str], counting: Sequence[str], axes: Mapping[str, Axis]
    ) -> None:
        """before, counting: columns of those before and of the one that counts; axes: by what stands on them."""
        self._name = name
        self._axes = {"time": Axis(("time",), 1.0, margin=0.0), **axes}
        self._before = ("time", *before)
        self.past = ColumnDataSource({column: [] for column in self._before})
        self.shown = ColumnDataSource({column: [] for column in ("time", *counting)})

    @property
    def targets(self) -> dict[str, Target]:
        ranges = {f"{self._name}_{what}": axis.range for what, axis in self._axes.items()}
        return {f"{self._name}_past": self.past, f"{self._name}_shown": self.shown, **ranges}

    def scale(self, made: figure, what: str) -> None:
        """Give a figure its axes."""
        made.x_range, made.y_range = self._axes["time"].range, self._axes[what].range

    def parts(
        self, injections: Sequence[SeenInjection], columns: Callable[[SeenInjection], Signals]
    ) -> Parts:
        drawn = [each for each in injections[-_OVERLAID:] if each.curves.time.size]
        if not drawn:
            return {}
        *before, last = drawn
        past = {name: _in_one([getattr(each.curves, name) for each in before]) for name in self._before}
        shown = {name: _thinned(each) for name, each in columns(last).items()}
        limits: dict[str, Limits] = {
            f"{self._name}_{what}": axis.limits(past, shown) for what, axis in self._axes.items()
        }
        return {f"{self._name}_past": past, f"{self._name}_shown": shown, **limits}


def _rates(seen: SeenInjection) -> Signals:
    curves, band = seen.curves, seen.band
    limits = {"low": curves.rate - band, "high": curves.rate + band}
    return {"time": curves.time, "rate": curves.rate, "nominal": curves.nominal, **limits}


def _details(seen: SeenInjection) -> Signals:
    curves = seen.curves
    rows = {name: getattr(curves, name) for name in ("time", *_NAMES)}
    return rows | dict(zip(_PHI, curves.phi, strict=True))


def _before(made: figure, column: str, past: ColumnDataSource) -> None:
    made.line("time", column, source=past, color=PAST, alpha=0.45, line_width=1.5)


def _in_one(curves: Sequence[Signal]) -> Signal:
    """One curve after the other, with gaps."""
    parts = [part for each in curves for part in (_thinned(each), _GAP)]
    return np.concatenate([_GAP, *parts])


def _thinned(values: Signal) -> Signal:
    step = max(1, -(-values.size // _POINTS))
    thinned: NDArray[np.float32] = values[::step].copy()
    return thinned
