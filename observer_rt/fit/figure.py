"""The figure of a fit: measured and modelled line pressure, and what is left by phase."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, ScalarFormatter

from observer_rt.evidence.figure_look import FOUND, GIVEN, LOOK, MEASURED
from observer_rt.evidence.measurement import open_time, rail_pressure_before
from observer_rt.evidence.operating_points import point_name
from observer_rt.fit.calibrate import GATE, Calibrated
from observer_rt.fit.parts import spread
from observer_rt.fit.report import phase_name, verdict_words
from observer_rt.fit.residuals import PartOverlay
from observer_rt.foundation.files import file_errors
from observer_rt.foundation.units import MEGAPASCAL, MILLISECOND

_MOST = 6  # overlays
_COLUMNS = 3
_SHOWN = 4e-3  # s after the opening
_LEAST = 0.1  # of a chi2 on the axis


def draw_fit(path: Path, done: Calibrated) -> None:
    """Write the figure; its kind is that of the suffix."""
    overlays = spread(done.comparison.overlays, _MOST)
    rows = -(-len(overlays) // _COLUMNS)
    with mpl.rc_context(LOOK):
        figure = Figure(figsize=(12.0, 2.9 * rows + 3.6), layout="constrained")
        grid = figure.add_gridspec(rows + 1, _COLUMNS, height_ratios=[1.0] * rows + [1.15])
        for number, overlay in enumerate(overlays):
            axes = figure.add_subplot(grid[number // _COLUMNS, number % _COLUMNS])
            _overlay(axes, overlay, legend=number == 0)
        _phases(figure.add_subplot(grid[rows, :]), done)
        figure.suptitle(f"{done.fitted.structure.name}: {verdict_words(done).split('. ')[0]}", fontsize=11)
        with file_errors(path):
            figure.savefig(path, dpi=110)


def _overlay(axes: Axes, overlay: PartOverlay, legend: bool) -> None:
    """The first injection of a part."""
    measurement, one = overlay.part.measurement, overlay.after[0]
    recording, interval = measurement.recording, measurement.interval
    shown = one.samples[: round(_SHOWN / interval)]
    since = (shown - shown[0]) * interval / MILLISECOND
    axes.plot(since, recording.line_pressure[shown] / MEGAPASCAL, color=MEASURED, lw=0.8, label="measured")
    if overlay.before:
        before = overlay.before[0].line_pressure[: shown.size]
        axes.plot(since, before / MEGAPASCAL, color=GIVEN, lw=1.0, ls="--", label="file")
    axes.plot(since, one.line_pressure[: shown.size] / MEGAPASCAL, color=FOUND, lw=1.0, label="fitted")
    point = point_name(rail_pressure_before(one.event, recording), open_time(one.event, recording))
    axes.set_title(point, fontsize=9)
    axes.set_xlabel("time since opening [ms]")
    axes.set_ylabel("line pressure [MPa]")
    if legend:
        axes.legend(frameon=False, fontsize=8)


def _phases(axes: Axes, done: Calibrated) -> None:
    """chi2 of every signal and phase, before and after."""
    residuals = done.comparison.residuals
    places = np.arange(len(residuals))
    before, after = ([one.chi2[which] for one in residuals] for which in (0, 1))
    both = bool(np.isfinite(before).any())
    if both:
        axes.bar(places - 0.2, before, 0.38, color=GIVEN, label="file")
    axes.bar(places + 0.2 * both, after, 0.38, color=FOUND, label="fitted")
    axes.axhline(GATE, color="#59636e", lw=1.0, ls=":")
    axes.text(len(residuals) - 0.55, GATE, "limit", va="bottom", ha="right", fontsize=8, color="#59636e")
    axes.axhline(1.0, color="#59636e", lw=0.6)
    axes.grid(visible=False, axis="x")
    axes.set_yscale("log")
    axes.set_ylim(_LEAST, 1.5 * float(np.nanmax([*before, *after, GATE])))
    axes.yaxis.set_major_formatter(ScalarFormatter())
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_xticks(places, [f"{phase_name(one.phase)}\n{one.signal.words}" for one in residuals])
    axes.set_ylabel("chi2 (1: noise alone)")
    axes.legend(frameon=False, fontsize=8, loc="upper right")
