"""Figures of an accuracy run: error against wear, learning curve, coverage of the intervals."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from tools.benchmarks.bars import WEAR, by_class, coverage
from tools.benchmarks.cases import CLASSES, Group
from tools.benchmarks.report import clopper_pearson
from tools.benchmarks.score import OBSERVER, CaseScore

COLOURS = ("#d1495b", "#8d99ae", "#00798c", "#66a182", "#edae49", "#5f4b8b")


def save_figures(scores: Sequence[CaseScore], folder: Path) -> tuple[Path, ...]:
    """Every figure these scores have something for, as PNG; returns the files."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    wear = [s for s in scores if s.class_name == "orifice_area"]
    if wear:
        written.append(_error_against_wear(wear, folder / "error_against_wear.png"))
    worn = [s for s in scores if s.class_name in WEAR]
    if worn:
        written.append(_learning_curve(worn, folder / "learning_curve.png"))
    covered = {name: c for name, cases in by_class(scores).items() if (c := coverage(cases))}
    if covered:
        main = [name for name in covered if CLASSES[name].group is Group.MAIN]
        what = "share of 95 % intervals of the mass that hold the truth"
        written.append(coverage_figure(covered, main, what, folder / "interval_coverage.png"))
    return tuple(written)


def _names(scores: Sequence[CaseScore]) -> list[str]:
    """Estimators that scored every one of the cases, ours last, so that it is drawn on top."""
    everywhere = [e.name for e in scores[0].estimators if all(s.has(e.name) for s in scores)]
    return sorted(everywhere, key=lambda name: name == OBSERVER)


def _style(name: str, names: Sequence[str]) -> dict[str, Any]:
    """Ours solid and bold; the peers thinner, dashed, so that those that agree are both seen."""
    if name == OBSERVER:
        return {"color": COLOURS[0], "label": name, "marker": "o", "markersize": 4, "linewidth": 1.4}
    number = 1 + sorted(set(names) - {OBSERVER}).index(name)
    dashes = (0, (4, number))
    return {
        "color": COLOURS[number],
        "label": name,
        "marker": "o",
        "markersize": 3,
        "linestyle": dashes,
        "linewidth": 1.0,
    }


def _error_against_wear(scores: Sequence[CaseScore], path: Path) -> Path:
    """Our Fig. 5: largest mass error of a valid injection and rate error against v_H, every estimator."""
    figure, (masses, rates) = plt.subplots(2, 1, figsize=(8.0, 7.0), sharex=True, layout="constrained")
    ordered = sorted(scores, key=lambda s: s.nozzle_wear)
    wear = [s.nozzle_wear for s in ordered]
    names = _names(ordered)
    for name in names:
        style = _style(name, names)
        masses.plot(wear, [s.largest_error_pct(name) for s in ordered], **style)
        rates.plot(wear, [s.rate_rmse(name) for s in ordered], **style)
    masses.set(yscale="log", ylabel="largest mass error of a valid injection [%]")
    rates.set(yscale="log", ylabel="rate RMSE [mm3/ms]", xlabel="nozzle wear v_H")
    figure.legend(*masses.get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False)
    return saved(figure, (masses, rates), path)


def _learning_curve(scores: Sequence[CaseScore], path: Path) -> Path:
    """Mass error event by event under wear: median and 95th percentile over the cases."""
    figure, axes = plt.subplots(figsize=(8.0, 4.5), layout="constrained")
    names = _names(scores)
    for name in names:
        errors = np.abs([s.event_errors_pct(name) for s in scores])
        events = np.arange(1, errors.shape[1] + 1)
        style = _style(name, names)
        axes.plot(events, np.median(errors, axis=0), **style)
        axes.plot(
            events, np.percentile(errors, 95, axis=0), color=style["color"], linestyle=":", linewidth=1.0
        )
    axes.set(yscale="log", xlabel="event", ylabel="mass error [%]: median, 95 % of cases dotted")
    axes.set_xticks(events)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False)
    return saved(figure, (axes,), path)


def coverage_figure(
    covered: Mapping[str, Sequence[bool]], marked: Collection[str], xlabel: str, path: Path
) -> Path:
    """How often 95 % intervals hold the truth, with 99 % Clopper-Pearson bars; marked: in strong colours."""
    figure, axes = plt.subplots(figsize=(8.0, 0.9 + 0.26 * len(covered)), layout="constrained")
    for row, (name, cases) in enumerate(covered.items()):
        low, high = clopper_pearson(sum(cases), len(cases))
        bar, dot = (COLOURS[2], COLOURS[0]) if name in marked else (COLOURS[1], COLOURS[1])
        axes.plot([low, high], [row, row], color=bar, linewidth=1.5)
        axes.plot(np.mean(cases), row, "o", color=dot, markersize=4)
    axes.axvline(0.95, color="black", linewidth=0.8)
    axes.set_yticks(range(len(covered)), [f"{name} ({len(c)})" for name, c in covered.items()], fontsize=8)
    axes.invert_yaxis()
    axes.set(xlim=(0.0, 1.02), xlabel=xlabel)
    return saved(figure, (axes,), path)


def saved(figure: plt.Figure, axes: tuple[Axes, ...], path: Path) -> Path:
    """A figure as PNG, a grid in its axes."""
    for each in axes:
        each.grid(True, which="major", linewidth=0.4, alpha=0.6)
    figure.savefig(path, dpi=120)
    plt.close(figure)
    return path
