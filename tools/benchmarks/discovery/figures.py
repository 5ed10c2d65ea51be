"""Figures of a discovery run: confusion matrix, detection limits, reliability of the confidence, intervals, gaps."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from tools.benchmarks.discovery import result as results_of
from tools.benchmarks.discovery.hidden import HEALTHY, HIDDEN
from tools.benchmarks.discovery.result import (
    AMBIGUOUS,
    NONE,
    SEVERAL,
    UNKNOWN,
    VISIBLE_GAIN,
    CaseResult,
)
from tools.benchmarks.discovery.tables import printed_size
from tools.benchmarks.figures import coverage_figure, saved
from tools.benchmarks.report import clopper_pearson

RED, GREY, BLUE, GREEN = "#d1495b", "#8d99ae", "#00798c", "#66a182"
LEAST_GAIN = 0.5  # drawn where the oracle gains less
CALIBRATION_BAND = 0.1
SIGNALS = {"line_pressure": ("line pressure", BLUE), "injected_mass": ("injected mass", RED)}


def save_figures(results: Sequence[CaseResult], folder: Path) -> tuple[Path, ...]:
    """Every figure these results have something for, as PNG; returns the files."""
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    if results:
        written.append(_confusion(results, folder / "confusion.png"))
    if results_of.faulty(results):
        written.append(_detection(results, folder / "detection_limits.png"))
    if results_of.reliability(results):
        written.append(_reliability(results, folder / "reliability.png"))
    if results_of.coverage(results):
        by_effect = {name: results_of.coverage(c) for name, c in results_of.by_effect(results).items()}
        covered = {name: c for name, c in by_effect.items() if c} | {"all": results_of.coverage(results)}
        what = "share of 95 % intervals that hold the true value"
        written.append(coverage_figure(covered, ["all"], what, folder / "interval_coverage.png"))
    if results_of.worst_gap_shares(results):
        written.append(_gaps(results, folder / "gap_left.png"))
    return tuple(written)


def _confusion(results: Sequence[CaseResult], path: Path) -> Path:
    """Share of each answer to each hidden effect above noise; counts as numbers."""
    rows = {name: results_of.above_noise(cases) for name, cases in results_of.by_effect(results).items()}
    rows[HEALTHY] = results_of.healthy(results)
    rows = {name: cases for name, cases in rows.items() if cases}
    answers = [*HIDDEN, SEVERAL, AMBIGUOUS, UNKNOWN, NONE]
    counts = np.array([[sum(r.answer == a for r in cases) for a in answers] for cases in rows.values()])
    counts = counts.reshape(len(rows), len(answers))
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    figure, axes = plt.subplots(figsize=(12.0, 2.6 + 0.34 * len(rows)), layout="constrained")
    image = axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    for (i, j), count in np.ndenumerate(counts):
        if count:
            axes.text(j, i, str(count), ha="center", va="center", fontsize=8,
                      color="white" if shares[i, j] > 0.5 else "black")  # fmt: skip
    axes.set_xticks(range(len(answers)), answers, rotation=55, ha="right", fontsize=8)
    axes.set_yticks(range(len(rows)), list(rows), fontsize=8)
    axes.axvline(len(HIDDEN) - 0.5, color="black", linewidth=0.8)
    axes.set(xlabel="answered", ylabel="hidden, above noise")
    figure.colorbar(image, label="share of the cases", pad=0.01)
    return saved(figure, (), path)


def _detection(results: Sequence[CaseResult], path: Path) -> Path:
    """Every faulty case by how much the oracle gains, found or not; the size found from on as text."""
    effects = results_of.by_effect(results)
    figure, axes = plt.subplots(figsize=(9.0, 1.6 + 0.3 * len(effects)), layout="constrained")
    kinds = (
        ("right", GREEN, "o", lambda r: r.right),
        ("missed, above noise", RED, "X", lambda r: not r.right and r.above_noise),
        ("missed, below noise", GREY, "x", lambda r: not r.right and not r.above_noise),
    )
    for label, colour, marker, belongs in kinds:
        found = [
            (max(r.visibility.gain, LEAST_GAIN), row)
            for row, cases in enumerate(effects.values())
            for r in cases
            if r.visibility is not None and belongs(r)
        ]
        if found:
            axes.scatter(*zip(*found, strict=True), c=colour, marker=marker, s=26, label=label, alpha=0.8)
    axes.axvline(VISIBLE_GAIN, color="black", linewidth=0.8)
    axes.set(xscale="log", xlabel="what the oracle gains in -2 log L by the hidden effect")
    axes.set_yticks(range(len(effects)), list(effects), fontsize=8)
    axes.invert_yaxis()
    axes.set_title("found from", loc="right", fontsize=8)
    limits = axes.secondary_yaxis("right")
    texts = [printed_size(name, results_of.detection_limit(cases)) for name, cases in effects.items()]
    limits.set_yticks(range(len(effects)), texts, fontsize=8)
    axes.grid(True, axis="x", linewidth=0.4, alpha=0.6)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False)
    return saved(figure, (), path)


def _reliability(results: Sequence[CaseResult], path: Path) -> Path:
    """Share of right names against the confidence they were given with, with 99 % Clopper-Pearson bars."""
    bins = results_of.reliability(results)
    figure, axes = plt.subplots(figsize=(5.5, 5.0), layout="constrained")
    unit = np.array([0.0, 1.0])
    axes.fill_between(unit, unit - CALIBRATION_BAND, unit + CALIBRATION_BAND, color=GREY, alpha=0.2)
    axes.plot(unit, unit, color="black", linewidth=0.8)
    for number, b in enumerate(bins):
        low, high = clopper_pearson(round(b.right_share * b.names), b.names)
        axes.plot([b.confidence] * 2, [low, high], color=BLUE, linewidth=1.5)
        place = (-6, -12 - 11 * (number % 3))  # below and beside its point, clear of the next
        axes.annotate(str(b.names), (b.confidence, b.right_share), place, fontsize=8,
                      textcoords="offset points", ha="right")  # fmt: skip
    axes.plot([b.confidence for b in bins], [b.right_share for b in bins], "o-", color=RED, markersize=5)
    error = results_of.calibration_error(results)
    axes.set(xlim=(0.0, 1.02), ylim=(0.0, 1.04), xlabel="confidence given", ylabel="share of right names")
    axes.set_title(f"calibration error {error:.3f}; names given at each point", fontsize=9)
    return saved(figure, (axes,), path)


def _gaps(results: Sequence[CaseResult], path: Path) -> Path:
    """Distribution of what is left of the gap on recordings `discover` never saw."""
    figure, axes = plt.subplots(figsize=(7.0, 4.0), layout="constrained")
    for signal, (label, colour) in SIGNALS.items():
        shares = np.sort(results_of.gap_shares(results, signal))
        if shares.size:
            part = np.arange(1, shares.size + 1) / shares.size
            axes.step(shares, part, where="post", color=colour, label=f"{label} ({shares.size} cases)")
    axes.axvline(results_of.GAP_MEDIAN, color="black", linewidth=0.8, linestyle="--")
    axes.axvline(results_of.GAP_P90, color="black", linewidth=0.8)
    axes.set_xscale("symlog", linthresh=0.05)
    axes.set(
        xlabel="share of the gap left (0: as the oracle, 1: as without the effect)", ylabel="share of cases"
    )
    axes.legend(frameon=False)
    return saved(figure, (axes,), path)
