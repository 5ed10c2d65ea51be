"""What is drawn of all injections of recordings: masses, and the wear learned, one injection after another."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from observer_rt.estimation.scalars import NOZZLE, SEAT
from observer_rt.evaluation.curves import RateCurves
from observer_rt.foundation.units import MILLIGRAM
from observer_rt.observer.learning.indicators import Estimate

ESTIMATED, NOMINAL, REFERENCE = "#d62728", "#1f77b4", "#222222"
RECORDINGS = ("#d62728", "#1f77b4", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf", "#8c564b", "#e377c2")
ANNOTATED = 24  # injections whose masses are bars with numbers; more are lines
WEAR = {NOZZLE: ("nozzle flow, v_H", "#d62728", "-"), SEAT: ("seat flow, v_S", "#9467bd", ":")}
"""What is learned of an injector: name, colour and line where one recording is drawn."""
PERCENT = 100.0


@dataclass(frozen=True)
class MassRow:
    """Masses of one injection [kg], and the wear learned by it, by effect."""

    number: int
    estimated: float
    nominal: float
    reference: float | None
    valid: bool
    ci95: tuple[float, float] | None = None
    wear: Mapping[str, Estimate] = field(default_factory=dict)


@dataclass(frozen=True)
class Picture:
    """What is drawn of one recording: curves of some injections by number, masses and wear of all."""

    title: str
    curves: Mapping[int, RateCurves]
    masses: Sequence[MassRow]


def draw_masses(axes: Axes, recordings: Sequence[Picture], reference: str) -> None:
    """Errors of the masses where all have a reference, else masses."""
    rows = [row for one in recordings for row in one.masses]
    against = bool(rows) and all(row.reference for row in rows)
    label = f"mass error against {reference}\n[%]" if against else "injected mass\n[mg]"
    if against:
        axes.axhline(0, color=REFERENCE, lw=0.8)
    most = max((len(one.masses) for one in recordings), default=0)
    for i, one in enumerate(recordings):
        series = _series(one.masses, against)
        if len(recordings) == 1 and most <= ANNOTATED:
            _draw_bars(axes, series)
        else:
            colour = ESTIMATED if len(recordings) == 1 else RECORDINGS[i % len(RECORDINGS)]
            nominal = NOMINAL if len(recordings) == 1 else colour
            _draw_points(axes, series, colour, nominal)
    axes.set(xlabel="injection", ylabel=label)
    axes.margins(y=0.12)
    axes.xaxis.set_major_locator(MaxNLocator(ANNOTATED, integer=True, min_n_ticks=1))
    axes.grid(axis="y", alpha=0.3)
    if not rows:
        axes.text(0.5, 0.5, "no injection found", ha="center", transform=axes.transAxes)
    elif not all(row.valid for row in rows):
        how = "hatched" if len(recordings) == 1 and most <= ANNOTATED else "grey crosses"
        axes.set_title(f"{how}: observer not valid", loc="right", fontsize=9)


@dataclass(frozen=True, eq=False)
class _Series:
    """What is drawn of the masses of n injections, in the printed unit: (n,), interval (2, n)."""

    numbers: NDArray[np.float64]
    estimated: NDArray[np.float64]
    nominal: NDArray[np.float64]
    interval: NDArray[np.float64]
    valid: NDArray[np.bool_]


def _series(masses: Sequence[MassRow], against: bool) -> _Series:
    """against: as errors against the reference [%], else [mg]."""
    estimated, nominal = (
        np.array([getattr(row, name) for row in masses]) for name in ("estimated", "nominal")
    )
    interval = np.array([row.ci95 or (np.nan, np.nan) for row in masses]).reshape(-1, 2).T
    numbers = np.array([row.number for row in masses], float)
    valid = np.array([row.valid for row in masses], np.bool_)
    truth = np.array([row.reference for row in masses], float)

    def shown(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return PERCENT * (values / truth - 1.0) if against else values / MILLIGRAM

    return _Series(numbers, shown(estimated), shown(nominal), shown(interval), valid)


def _draw_bars(axes: Axes, series: _Series) -> None:
    axes.bar(series.numbers - 0.2, series.nominal, 0.38, color=NOMINAL)
    bars = axes.bar(series.numbers + 0.2, series.estimated, 0.38, color=ESTIMATED)
    axes.vlines(series.numbers + 0.2, *series.interval, color=REFERENCE, lw=1.2)
    tops = np.fmax(series.interval[1], series.estimated)
    for bar, number, value, top, is_valid in zip(
        bars, series.numbers, series.estimated, tops, series.valid, strict=True
    ):
        if not is_valid:
            bar.set(alpha=0.35, hatch="//")
        if np.isfinite(value):
            place = number + 0.2, max(top, 0.0)
            axes.annotate(f"{value:.2f}", place, (0, 2), textcoords="offset points", ha="center", fontsize=7)


def _draw_points(axes: Axes, series: _Series, colour: str, nominal: str) -> None:
    """Points by themselves: from one injection to the next the operating point changes."""
    size = float(np.clip(400.0 / max(1, series.numbers.size), 1.5, 5.0))
    axes.vlines(series.numbers, *series.interval, color=colour, alpha=0.35, lw=0.6 * size)
    axes.plot(series.numbers, series.nominal, "_", color=nominal, ms=2.0 * size)
    axes.plot(series.numbers, series.estimated, ".", color=colour, ms=2.0 * size)
    wrong = ~series.valid
    axes.plot(series.numbers[wrong], series.estimated[wrong], "x", color="#666666", ms=1.4 * size)


def draw_wear(axes: Axes, recordings: Sequence[Picture]) -> None:
    """Wear over injections with its 95 % interval, as far as it is known."""
    axes.axhline(0, color=REFERENCE, lw=0.8)
    shown: list[NDArray[np.float64]] = []
    for i, one in enumerate(recordings):
        numbers = np.array([row.number for row in one.masses], float)
        for effect, (_, own, style) in WEAR.items():
            known = [row.wear.get(effect, Estimate(np.nan)) for row in one.masses]
            value = PERCENT * np.array([estimate.value for estimate in known])
            half = PERCENT * 1.96 * np.array([estimate.sigma or np.nan for estimate in known])
            colour = own if len(recordings) == 1 else RECORDINGS[i % len(RECORDINGS)]
            axes.fill_between(numbers, value - half, value + half, color=colour, alpha=0.18, lw=0)
            axes.plot(
                numbers,
                value,
                style,
                color=colour,
                lw=1.4,
                marker="." if len(numbers) <= ANNOTATED else None,
            )
            shown += [value, *_late(value - half), *_late(value + half)]
    values = np.concatenate(shown) if shown else np.zeros(0)
    values = values[np.isfinite(values)]
    if values.size:
        low, high = min(values.min(), 0.0), max(values.max(), 0.0)
        margin = 0.1 * (high - low) or 1.0
        axes.set_ylim(low - margin, high + margin)
    handles = [
        Line2D([], [], color=own if len(recordings) == 1 else REFERENCE, ls=style, label=name)
        for name, own, style in WEAR.values()
    ]
    axes.legend(
        handles=handles, loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize=8, frameon=False, ncols=2
    )
    axes.set(xlabel="injection", ylabel="learned change,\n95 % interval [%]")
    axes.grid(alpha=0.3)


def _late(values: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """The second half, for the range shown: the first intervals are as wide as what is known beforehand."""
    return [values[values.size // 2 :]]
