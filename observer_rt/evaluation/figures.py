"""Figures of evaluated recordings."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from observer_rt.evaluation.curves import RateCurves, rate_curves, shown_numbers
from observer_rt.evaluation.evaluate import Evaluation
from observer_rt.evaluation.injections import InjectionResult
from observer_rt.foundation.units import MILLIGRAM, MILLISECOND, MM3_PER_MS

ESTIMATED, NOMINAL, REFERENCE = "#d62728", "#1f77b4", "#222222"
ANNOTATED = 24  # injections whose masses are also written as numbers


@dataclass(frozen=True)
class MassRow:
    """Masses of one injection [kg]."""

    number: int
    estimated: float
    nominal: float
    reference: float | None
    valid: bool


def plot_injections(
    path: Path, title: str, curves: Sequence[RateCurves], masses: Sequence[MassRow], reference: str
) -> None:
    """Write a figure (format by suffix): rate curves above, masses or mass errors of all injections below.

    `reference` names what the estimates are compared with ("true", "measured").
    """
    figure = plt.figure(figsize=(max(8.4, 4.2 * len(curves)), 6.4), layout="constrained")
    grid = figure.add_gridspec(2, max(1, len(curves)), height_ratios=(3, 2))
    for column, curve in enumerate(curves):
        axes = figure.add_subplot(grid[0, column])
        _draw_curves(axes, curve, reference)
        if column == 0:
            axes.set_ylabel("injection rate [mm³/ms]")
            figure.legend(
                *axes.get_legend_handles_labels(), loc="outside upper right", ncols=4, frameon=False
            )
    _draw_masses(figure.add_subplot(grid[1, :] if curves else grid[:, :]), masses, reference)
    figure.suptitle(title, x=0.01, ha="left")
    figure.savefig(path, dpi=130)
    plt.close(figure)


def evaluation_curves(evaluation: Evaluation, results: Sequence[InjectionResult]) -> list[RateCurves]:
    """Curves of the first, a middle and the last injection of a recording in memory."""
    return [
        rate_curves(
            results[number].report,
            evaluation.first_index,
            evaluation.recording.time,
            evaluation.trace,
            evaluation.recording.injection_rate,
        )
        for number in shown_numbers(len(results))
    ]


def evaluation_masses(results: Sequence[InjectionResult]) -> list[MassRow]:
    """Masses of all injections of a recording."""
    return [
        MassRow(
            result.report.number,
            result.report.mass,
            result.nominal_mass,
            None if np.isnan(result.measured_mass) else result.measured_mass,
            result.report.valid,
        )
        for result in results
    ]


def _draw_curves(axes: Axes, curve: RateCurves, reference: str) -> None:
    time = curve.time / MILLISECOND
    if curve.reference is not None:
        axes.plot(time, curve.reference / MM3_PER_MS, color=REFERENCE, lw=2.4, label=reference)
    if curve.sigma is not None:
        low, high = ((curve.estimated + side * 1.96 * curve.sigma) / MM3_PER_MS for side in (-1, 1))
        axes.fill_between(time, low, high, color=ESTIMATED, alpha=0.2, lw=0, label="its 95 % interval")
    axes.plot(time, curve.estimated / MM3_PER_MS, color=ESTIMATED, lw=1.4, label="observer")
    axes.plot(time, curve.nominal / MM3_PER_MS, color=NOMINAL, ls="--", lw=1.4, label="nominal model")
    axes.set(title=curve.title, xlabel="time [ms]")
    axes.grid(alpha=0.3)


def _draw_masses(axes: Axes, masses: Sequence[MassRow], reference: str) -> None:
    numbers = np.array([row.number for row in masses])
    estimated = np.array([row.estimated for row in masses])
    nominal = np.array([row.nominal for row in masses])
    if masses and all(row.reference for row in masses):
        truth = np.array([row.reference for row in masses], float)
        series = [100 * (nominal / truth - 1), 100 * (estimated / truth - 1)]
        label = f"mass error against {reference} [%]"
        axes.axhline(0, color=REFERENCE, lw=0.8)
    else:
        series = [nominal / MILLIGRAM, estimated / MILLIGRAM]
        label = "injected mass [mg]"
    axes.bar(numbers - 0.2, series[0], 0.38, color=NOMINAL)
    bars = axes.bar(numbers + 0.2, series[1], 0.38, color=ESTIMATED)
    for bar, row in zip(bars, masses, strict=True):
        if not row.valid:
            bar.set(alpha=0.35, hatch="//")
    if len(masses) <= ANNOTATED:
        for number, value in zip(numbers, series[1], strict=True):
            if np.isfinite(value):
                axes.annotate(
                    f"{value:.2f}", (number + 0.2, max(value, 0)), ha="center", va="bottom", fontsize=7
                )
    axes.set(xlabel="injection (hatched: observer not valid)", ylabel=label)
    axes.margins(y=0.12)
    axes.xaxis.set_major_locator(MaxNLocator(ANNOTATED, integer=True, min_n_ticks=1))
    axes.grid(axis="y", alpha=0.3)
    if not masses:
        axes.text(0.5, 0.5, "no injection found", ha="center", transform=axes.transAxes)
