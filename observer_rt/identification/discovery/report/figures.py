"""Figures of the report, as SVG to stand in the page."""

from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import fill

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from observer_rt.foundation.figures import FOUND, GIVEN, MEASURED, svg_figure
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MILLISECOND, MM3_PER_MS
from observer_rt.identification.discovery.gaps import Gap
from observer_rt.identification.discovery.injections import Overlay
from observer_rt.identification.discovery.report.numbers import sign
from observer_rt.identification.discovery.search.results import LawCurve

_FEWEST_PLACES = 3  # beside each other, for which there is room
_CROWDED = 9  # operating points, from which on labels are small
_WRAPPED = 30  # characters of a label beside a low figure


def overlay_figure(overlays: Sequence[Overlay], amended: str) -> str:
    """Lift, line pressure, what the models miss of it, and injection rate; a column for each injection.

    amended: what the legend calls the amended model.
    """
    with svg_figure(10.4, 7.4) as (figure, svg):
        _draw_overlays(figure, overlays, amended)
    return svg()


def _draw_overlays(figure: Figure, overlays: Sequence[Overlay], amended: str) -> None:
    grid = figure.add_gridspec(4, len(overlays), height_ratios=(0.55, 1.5, 1.0, 1.3))
    for column, one in enumerate(overlays):
        axes = [figure.add_subplot(grid[row, column]) for row in range(4)]
        _draw_overlay(axes, one, amended)
        for row, label in enumerate(
            (
                "needle lift\n[µm]",
                "line pressure\n[MPa]",
                "model − measured\n[MPa]",
                "injection rate\n[mm³/ms]",
            )
        ):
            axes[row].sharex(axes[0])
            axes[row].tick_params(labelbottom=row == 3)
            if column == 0:
                axes[row].set_ylabel(label)
        axes[0].set_title(one.title, loc="left", fontsize=10.5, fontweight="bold")
        axes[3].set_xlabel("time since the opening [ms]")
        if column == 0:
            handles, labels = axes[1].get_legend_handles_labels()
            figure.legend(handles, labels, loc="outside upper right", ncols=3, frameon=False)
    figure.align_ylabels()


def _draw_overlay(axes: Sequence[Axes], one: Overlay, amended: str) -> None:
    time = one.time / MILLISECOND
    axes[0].fill_between(time, one.lift / MICROMETRE, color="#dfe5ea", lw=0)
    axes[0].plot(time, one.lift / MICROMETRE, color="#59636e", lw=0.9)
    axes[1].plot(time, one.line_pressure / MEGAPASCAL, color=MEASURED, lw=1.5, alpha=0.75, label="measured")
    axes[1].plot(time, one.nominal_pressure / MEGAPASCAL, color=GIVEN, lw=1.1, label="model as given")
    floor = 2.0 * one.noise_floor / MEGAPASCAL
    axes[2].axhspan(-floor, floor, color="#e8ecef", lw=0)
    missed = one.nominal_pressure - one.line_pressure
    axes[2].plot(time, missed / MEGAPASCAL, color=GIVEN, lw=0.8)
    if one.measured_rate is not None:
        axes[3].plot(time, one.measured_rate / MM3_PER_MS, color=MEASURED, lw=1.5, alpha=0.75)
    axes[3].plot(time, one.nominal_rate / MM3_PER_MS, color=GIVEN, lw=1.1)
    if one.amended_pressure is not None and one.amended_rate is not None:
        axes[1].plot(
            time,
            one.amended_pressure / MEGAPASCAL,
            color=FOUND,
            lw=1.1,
            ls=(0, (5, 1.5)),
            label=amended,
        )
        missed = one.amended_pressure - one.line_pressure
        axes[2].plot(time, missed / MEGAPASCAL, color=FOUND, lw=0.8)
        axes[3].plot(time, one.amended_rate / MM3_PER_MS, color=FOUND, lw=1.1, ls=(0, (5, 1.5)))


@dataclass(frozen=True)
class Bars:
    """Gaps of one quantity at several operating points, in its printed unit.

    amended: what the legend calls the amended model, None where there is nothing to show of it.
    """

    title: str
    unit: str
    gaps: tuple[Gap, ...]
    amended: str | None


def gap_figure(labels: Sequence[str], groups: Sequence[Bars]) -> str:
    """Before and after beside each other at every operating point, in proportion; noise as a line."""
    with svg_figure(10.4, 3.1) as (figure, svg):
        for column, bars in enumerate(groups):
            axes = figure.add_subplot(1, len(groups), column + 1)
            _draw_bars(axes, labels, bars)
            if column == 0:
                handles = axes.get_legend_handles_labels()
                figure.legend(*handles, loc="outside upper right", ncols=3, frameon=False)
    return svg()


def _draw_bars(axes: Axes, labels: Sequence[str], bars: Bars) -> None:
    places = np.arange(len(labels))
    width = 0.5 if bars.amended is None else 0.36
    series = [("model as given", [g.before for g in bars.gaps], GIVEN, 0.0 if bars.amended is None else -0.2)]
    if bars.amended is not None:
        series.append((bars.amended, [g.after for g in bars.gaps], FOUND, 0.2))
    floors = np.array([g.noise_floor for g in bars.gaps])
    for label, values, colour, shift in series:
        heights = np.array(values)
        axes.bar(places + shift, heights, width, color=colour, label=label)
        tops = np.maximum(heights, floors)  # where the line does not strike the number through
        for place, top, height in zip(places + shift, tops, heights, strict=True):
            text = f"{height:.0f}" if height >= 10.0 else f"{height:#.2g}"
            axes.annotate(text, (place, top), (0, 2), textcoords="offset points", ha="center", fontsize=8)
    axes.hlines(floors, places - 0.45, places + 0.45, color=MEASURED, lw=1.4, label="noise alone")
    axes.margins(y=0.15)
    axes.set_ylim(bottom=0.0)
    axes.grid(axis="x", visible=False)
    axes.set_xticks(places, labels)
    spare = 0.6 + max(0.0, (_FEWEST_PLACES - places.size) / 2.0)  # a single bar need not fill the figure
    axes.set_xlim(-spare, places.size - 1.0 + spare)
    axes.set_ylabel(f"rms [{bars.unit}]")
    axes.set_title(bars.title, loc="left", fontsize=10.5, fontweight="bold")


@dataclass(frozen=True)
class RecordingResiduals:
    """Rms of the line pressure's gap on each injection of a recording [MPa], before and after."""

    title: str
    before: Sequence[float]
    after: Sequence[float]
    held_out: bool


def residual_figure(groups: Sequence[RecordingResiduals], floor: float, amended: str | None) -> str:
    """Every injection in order, recordings beside each other; those held out on grey.

    floor: what noise alone leaves [MPa]; amended: what the legend calls the amended model, None without one.
    """
    with svg_figure(10.4, 2.9) as (figure, svg):
        axes = figure.add_subplot()
        start = 0.0
        for number, one in enumerate(groups):
            x = start + np.arange(len(one.before))
            label = number == 0
            axes.plot(x, one.before, "o", ms=4, color=GIVEN, label="model as given" if label else None)
            if amended is not None:
                axes.plot(x, one.after, "o", ms=4, color=FOUND, label=amended if label else None)
            if one.held_out:
                axes.axvspan(x[0] - 0.7, x[-1] + 0.7, color="#eef1f4", lw=0, zorder=0)
            start = x[-1] + 2.4
        axes.axhline(floor, color=MEASURED, lw=1.2, label="noise alone")
        widths = [len(one.before) for one in groups]
        starts = np.cumsum([0.0, *(width + 1.4 for width in widths[:-1])])
        middles = [first + (width - 1) / 2.0 for first, width in zip(starts, widths, strict=True)]
        axes.set_xticks(middles, [one.title.replace(", ", "\n") for one in groups])
        axes.tick_params(axis="x", length=0, labelsize=8 if len(groups) > _CROWDED else None)
        axes.grid(axis="x", visible=False)
        axes.set_ylim(bottom=0.0)
        axes.margins(x=0.02)
        axes.set_ylabel("line pressure,\nrms [MPa]")
        figure.legend(*axes.get_legend_handles_labels(), loc="outside upper right", ncols=3, frameon=False)
    return svg()


def laws_figure(curves: Sequence[LawCurve]) -> str:
    """Laws over their variables, with the band of their coefficients, and the points of a free curve."""
    with svg_figure(10.4, 3.1) as (figure, svg):
        for column, one in enumerate(curves):
            axes = figure.add_subplot(1, len(curves), column + 1)
            law, low, high = one.law
            axes.fill_between(one.x, low, high, color=FOUND, alpha=0.2, lw=0)
            axes.plot(one.x, law, color=FOUND, lw=1.4, label="law")
            axes.errorbar(
                one.at, one.points, one.half, color=MEASURED, fmt="o", ms=3.5, lw=1.0, label="recordings"
            )
            axes.set_xlabel(one.words if one.unit == "-" else f"{one.words} [{one.unit}]")
            equation = one.term.equation
            unit = "" if equation.is_share else f" [{sign(str(equation.unit))}]"
            axes.set_ylabel(fill(f"{equation.words}{unit}", _WRAPPED))
            if column == 0:
                handles = axes.get_legend_handles_labels()
                figure.legend(*handles, loc="outside upper right", ncols=2, frameon=False)
    return svg()
