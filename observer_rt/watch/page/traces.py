"""The last injections over each other: pressures, lift, rate with its band, phi."""

from collections.abc import Sequence

import numpy as np
from bokeh.models import ColumnDataSource
from bokeh.models.ranges import DataRange1d
from bokeh.plotting import figure
from numpy.typing import NDArray

from observer_rt.watch.injection import Curves, SeenInjection, Signal
from observer_rt.watch.page.look import BAND, NOMINAL, OBSERVER, PAST, SECOND, THIRD, panel, with_legend

_OVERLAID = 8  # injections, the one shown included
_POINTS = 300  # of a curve, at the most: a screen shows no more
_TIME = "time from the beginning, ms"
_DETAILS = (  # the last: what the axis shows at least, so that noise looks like noise
    ("line_pressure", "Line pressure", "MPa", 20.0),
    ("rail_pressure", "Rail pressure", "MPa", 20.0),
    ("needle_lift", "Needle lift", "µm", 50.0),
)
_NAMES = tuple(name for name, *_ in _DETAILS)


class RatePanel:
    """The injection rate of one injector, nominal and estimated, over those of the injections before."""

    def __init__(self, injector: str) -> None:
        """injector: its name, empty for the only one."""
        self.figure = panel(f"Injection rate {injector}".strip(), _TIME, "mm³/ms", 360)
        self._past = ColumnDataSource({"time": [], "rate": []})
        self._shown = ColumnDataSource({name: [] for name in ("time", "rate", "nominal", "low", "high")})
        _before(self.figure, "rate", self._past)
        self.figure.varea(
            "time", "low", "high", source=self._shown, color=BAND, alpha=0.6, legend_label="95 %"
        )
        for column, colour, dash, label in (
            ("nominal", NOMINAL, "dashed", "nominal"),
            ("rate", OBSERVER, "solid", "observer"),
        ):
            self.figure.line(
                "time",
                column,
                source=self._shown,
                color=colour,
                line_width=4,
                line_dash=dash,
                legend_label=label,
                name=column,
            )
        with_legend(self.figure)

    def show(self, injections: Sequence[SeenInjection]) -> None:
        """Draw some injections, the last of them as the one that counts."""
        before, last = _overlaid(injections)
        self._past.data = _past_columns(before, ("rate",))
        if last is not None:
            curves, band = last.curves, last.band
            columns = {"rate": curves.rate, "nominal": curves.nominal}
            columns |= {"low": curves.rate - band, "high": curves.rate + band}
            self._shown.data = _columns(curves, columns)


class DetailPanels:
    """What lies behind the rate: pressures, lift, the three rows of phi."""

    def __init__(self) -> None:
        phi_names = [f"phi_{row}" for row in (1, 2, 3)]
        self._past = ColumnDataSource({name: [] for name in ("time", *_NAMES)})
        self._shown = ColumnDataSource({name: [] for name in ("time", *_NAMES, *phi_names)})
        self.figures: dict[str, figure] = {}
        for name, title, unit, span in _DETAILS:
            made = self.figures[name] = panel(title, _TIME, unit)
            made.y_range = DataRange1d(min_interval=span)
            _before(made, name, self._past)
            made.line("time", name, source=self._shown, color=OBSERVER, line_width=3)
        phi = self.figures["phi"] = panel("Correction phi", _TIME, "1/s")
        for name, colour in zip(phi_names, (OBSERVER, SECOND, THIRD), strict=True):
            phi.line(
                "time",
                name,
                source=self._shown,
                color=colour,
                line_width=3,
                legend_label=name.replace("_", " "),
            )
        with_legend(phi)

    def show(self, injections: Sequence[SeenInjection]) -> None:
        """Draw some injections, the last of them as the one that counts."""
        before, last = _overlaid(injections)
        self._past.data = _past_columns(before, _NAMES)
        if last is not None:
            columns = {name: getattr(last.curves, name) for name in _NAMES}
            columns |= {f"phi_{row + 1}": last.curves.phi[row] for row in range(3)}
            self._shown.data = _columns(last.curves, columns)


def _before(made: figure, column: str, past: ColumnDataSource) -> None:
    made.multi_line("time", column, source=past, color=PAST, alpha=0.45, line_width=1.5)


def _overlaid(injections: Sequence[SeenInjection]) -> tuple[list[Curves], SeenInjection | None]:
    shown = [each for each in injections[-_OVERLAID:] if each.curves.time.size]
    return [each.curves for each in shown[:-1]], (shown[-1] if shown else None)


def _past_columns(before: Sequence[Curves], names: Sequence[str]) -> dict[str, list[Signal]]:
    return {name: [_thinned(getattr(curves, name)) for curves in before] for name in ("time", *names)}


def _columns(curves: Curves, values: dict[str, Signal]) -> dict[str, Signal]:
    return {"time": _thinned(curves.time)} | {name: _thinned(each) for name, each in values.items()}


def _thinned(values: Signal) -> Signal:
    step = max(1, -(-values.size // _POINTS))
    thinned: NDArray[np.float32] = values[::step].copy()
    return thinned
