"""Figures of evaluated recordings: curves of some injections, masses and wear of all."""

from collections.abc import Collection, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from observer_rt.estimation.scalars import NOZZLE, SEAT
from observer_rt.evaluation.curves import InjectionResult, RateCurves
from observer_rt.evaluation.event_axes import (
    ESTIMATED,
    NOMINAL,
    RECORDINGS,
    REFERENCE,
    MassRow,
    Picture,
    draw_masses,
    draw_wear,
)
from observer_rt.evaluation.streamed import StreamedEvaluation
from observer_rt.foundation.units import MEGAPASCAL, MILLISECOND, MM3_PER_MS

COLUMNS = 4  # of curves side by side


def plot_injections(path: Path, recordings: Sequence[Picture], reference: str) -> None:
    """Write a figure (format by suffix): curves above, masses and wear of all injections below.

    Several recordings share all axes, each in a colour of its own. reference: what the estimates are compared with
    ("true", "measured").
    """
    numbers = sorted({number for one in recordings for number in one.curves})
    has_line = any(curve.line is not None for one in recordings for curve in one.curves.values())
    has_wear = any(row.wear for one in recordings for row in one.masses)
    rows, columns = -(-len(numbers) // COLUMNS), max(1, min(COLUMNS, len(numbers)))
    figure = plt.figure(
        figsize=(max(8.8, 4.1 * columns), rows * (3.4 + 2.2 * has_line) + 2.9 + 2.6 * has_wear + 0.8),
        layout="constrained",
    )
    parts = figure.add_gridspec(
        rows + 1, 1, height_ratios=[3.4 + 2.2 * has_line] * rows + [2.9 + 2.6 * has_wear]
    )
    for row in range(rows):
        grid = parts[row].subgridspec(1 + has_line, columns, height_ratios=(3.4, 2.2)[: 1 + has_line])
        for column, number in enumerate(numbers[row * COLUMNS : (row + 1) * COLUMNS]):
            axes = [figure.add_subplot(grid[k, column]) for k in range(1 + has_line)]
            _draw_injection(axes, recordings, number, reference, labelled=column == 0)
            if row == column == 0:
                _legend(figure, axes, recordings)
    below = parts[rows].subgridspec(1 + has_wear, 1, height_ratios=(2.9, 2.6)[: 1 + has_wear])
    masses = figure.add_subplot(below[0])
    draw_masses(masses, recordings, reference)
    if has_wear:
        wear = figure.add_subplot(below[1], sharex=masses)
        draw_wear(wear, recordings)
        masses.set_xlabel("")
    several = f"{len(recordings)} recordings; pale: {reference}, dashed: nominal model"
    figure.suptitle(recordings[0].title if len(recordings) == 1 else several, x=0.01, ha="left")
    figure.savefig(path, dpi=130)
    plt.close(figure)


def _legend(figure: Figure, axes: Sequence[Axes], recordings: Sequence[Picture]) -> None:
    """Of the recordings where there are several, else of the first injection's lines, the same in all."""
    handles: Sequence[Artist] = axes[0].get_legend_handles_labels()[0]
    if len(recordings) > 1:
        handles = [
            Line2D([], [], color=RECORDINGS[i % len(RECORDINGS)], label=one.title)
            for i, one in enumerate(recordings)
        ]
    figure.legend(handles=handles, loc="outside upper right", ncols=4, frameon=False)
    if len(axes) > 1 and len(recordings) == 1:
        axes[1].legend(
            loc="lower left", bbox_to_anchor=(0.0, 1.0), fontsize=8, frameon=False, ncols=2, borderpad=0.0
        )


def _draw_injection(
    axes: Sequence[Axes], recordings: Sequence[Picture], number: int, reference: str, labelled: bool
) -> None:
    """One injection of every recording that has it: rates, and line pressure below."""
    there = [(i, one.curves[number]) for i, one in enumerate(recordings) if number in one.curves]
    for i, curve in there:
        if len(recordings) == 1:
            _draw_rates(axes[0], curve, reference)
        else:
            _draw_rates_of_several(axes[0], curve, RECORDINGS[i % len(RECORDINGS)])
        if len(axes) > 1 and curve.line is not None:
            time, colour = curve.time / MILLISECOND, RECORDINGS[i % len(RECORDINGS)]
            measured = REFERENCE if len(recordings) == 1 else colour
            alpha = 0.55 if len(recordings) == 1 else 0.35
            pressures = [values / MEGAPASCAL for values in (curve.line.measured, curve.line.modelled)]
            axes[1].plot(time, pressures[0], color=measured, lw=2.2, alpha=alpha, label="measured")
            axes[1].plot(time, pressures[1], color=colour, lw=1.1, label="observer, from the opening on")
    axes[0].set_title(there[0][1].title if len(recordings) == 1 else f"injection {number}")
    for one in axes:
        one.grid(alpha=0.3)
    axes[-1].set_xlabel("time [ms]")
    if len(axes) > 1:
        axes[0].sharex(axes[1])
        axes[0].tick_params(labelbottom=False)
    if labelled:
        axes[0].set_ylabel("injection rate\n[mm³/ms]")
        if len(axes) > 1:
            axes[1].set_ylabel("line pressure\n[MPa]")


def _draw_rates(axes: Axes, curve: RateCurves, reference: str) -> None:
    time = curve.time / MILLISECOND
    if curve.reference is not None:
        axes.plot(time, curve.reference / MM3_PER_MS, color=REFERENCE, lw=2.4, label=reference)
    if curve.sigma is not None:
        low, high = ((curve.estimated + side * 1.96 * curve.sigma) / MM3_PER_MS for side in (-1, 1))
        axes.fill_between(time, low, high, color=ESTIMATED, alpha=0.2, lw=0, label="its 95 % interval")
    axes.plot(time, curve.estimated / MM3_PER_MS, color=ESTIMATED, lw=1.4, label="observer")
    axes.plot(time, curve.nominal / MM3_PER_MS, color=NOMINAL, ls="--", lw=1.4, label="nominal model")


def _draw_rates_of_several(axes: Axes, curve: RateCurves, colour: str) -> None:
    time = curve.time / MILLISECOND
    if curve.reference is not None:
        axes.plot(time, curve.reference / MM3_PER_MS, color=colour, lw=3.0, alpha=0.3)
    axes.plot(time, curve.estimated / MM3_PER_MS, color=colour, lw=1.4)
    axes.plot(time, curve.nominal / MM3_PER_MS, color=colour, ls="--", lw=0.9)


def picture_of(evaluation: StreamedEvaluation, numbers: Collection[int]) -> Picture:
    """Curves of the injections of these numbers, as far as the recording has them; masses and wear of all."""
    curves = {
        one.report.number: evaluation.curves[place]
        for place, one in enumerate(evaluation.injections)
        if one.report.number in numbers
    }
    return Picture(str(evaluation.path), curves, [_mass_row(one) for one in evaluation.injections])


def _mass_row(result: InjectionResult) -> MassRow:
    report = result.report
    return MassRow(
        report.number,
        report.mass,
        result.nominal_mass,
        None if np.isnan(result.measured_mass) else result.measured_mass,
        report.valid,
        report.mass_ci95,
        {effect: report.indicators[effect] for effect in (NOZZLE, SEAT)},
    )
