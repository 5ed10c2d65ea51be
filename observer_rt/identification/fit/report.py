"""Shows a fit: tables in printed units, and a figure."""

import math
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter, ScalarFormatter
from rich.console import Console
from rich.table import Table

from observer_rt.engine.estimation.phases import Phase
from observer_rt.foundation.console import plain_table, say
from observer_rt.foundation.figures import FOUND, GIVEN, LOOK, MEASURED, NotebookFigure, save_figure
from observer_rt.foundation.units import MEGAPASCAL, MILLISECOND, Z_95
from observer_rt.identification.fit.calibrate import CalibrationResult
from observer_rt.identification.fit.document import FitDocument, verdict_words
from observer_rt.identification.fit.forms import FittedNumber
from observer_rt.identification.fit.problem import spread
from observer_rt.identification.likelihood.events import open_time, rail_pressure_before
from observer_rt.identification.likelihood.excerpts import point_name
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.identification.likelihood.open_loop import SimulatedInjection, simulated

_MOST_OVERLAYS = 6  # overlays
_COLUMNS = 3
_SHOWN_TIME = 4e-3  # s after the opening
_LEAST_CHI2 = 0.1  # of a chi2 on the axis


def print_fit(fit: FitDocument, console: Console) -> None:
    """Structures, parameters, residuals, level and verdict."""
    say(console, "structures, by chi2 on recordings left out (1: noise alone)")
    structures = [
        (
            one.name,
            *(_figure(one.chi2[phase.label]) for phase in Phase),
            str(len(one.free)),
            "chosen" if one.name == fit.structure["name"] else "",
        )
        for one in fit.structures
        if one.chi2 is not None
    ]
    names = ("structure", *(phase.label for phase in Phase), "free", "")
    console.print(plain_table(names, structures, right=range(1, 7), folds=(0,)))
    for structure in fit.structures:
        if structure.failed:
            say(console, f"not fitted: {structure.name}: it {structure.failed}")
    say(console, f"chosen: {fit.structure['reason']}\n")
    say(console, "parameters")
    console.print(parameter_table(fit.parameters))
    for name, kept in fit.kept.items():
        value = f"{kept['value']:.4g} {kept['unit']}"
        say(console, f"{name} stays {value}: these recordings do not determine it")
    for line in fit.oddities:
        say(console, line)
    say(console, "\nresiduals, file -> fitted (rms one sample ahead; chi2 of means of 8 samples)")
    residuals = [
        (left.signal.value, left.phase, *_arrow(left.rms), left.unit, *_arrow(left.chi2)) for left in fit.residuals
    ]
    names = ("signal", "phase", "rms", "", "", "unit", "chi2", "", "")
    console.print(plain_table(names, residuals, right=(2, 3, 4, 6, 7, 8), folds=()))
    if weighed := [*_weighed(fit)]:
        say(console, "\nmasses [mg], measured and fitted")
        names = ("recording", "MPa", "measured", "fitted", "off", "sigmas")
        console.print(plain_table(names, weighed, right=range(1, 6), folds=(0,)))
    for line in _masses(fit):
        say(console, line)
    say(console, f"\nabsolute level: {fit.level['words']}")
    say(console, f"verdict: {fit.verdict_words}")


def parameter_table(parameters: Mapping[str, FittedNumber]) -> Table:
    """Fitted numbers before and after, with their intervals."""
    rows = [
        (
            name,
            size.symbol,
            "" if size.file is None else f"{size.file:.5g}",
            f"{size.value:.5g}",
            *("{:.5g} .. {:.5g}".format(*size.ci95), size.unit),
        )
        for name, size in parameters.items()
    ]
    return plain_table(("parameter", "", "file", "fitted", "95 % interval", "unit"), rows, right=(2, 3, 4), folds=())


def _weighed(fit: FitDocument) -> Iterator[tuple[str, ...]]:
    for mass in (*fit.masses, *fit.injections):
        if (measured := mass.measured_mass_mg) is not None and (fitted := mass.mass_mg["fitted"]) is not None:
            off = (fitted - measured) / (mass.measured_sigma_mg or math.nan)
            name, rail = Path(mass.recording).name, f"{mass.rail_pressure_MPa:.0f}"
            name += f", injection {mass.injection}" if mass.injection else ""
            yield name, rail, f"{measured:.2f}", f"{fitted:.2f}", f"{fitted / measured - 1.0:+.2%}", f"{off:+.1f}"


def _masses(fit: FitDocument) -> Iterable[str]:
    before, after = (np.array([one.mass_mg[by] for one in fit.masses], float) for by in ("file", "fitted"))
    if np.isfinite(before).all():
        yield f"mass of an injection, mean: {np.mean(before):.2f} -> {np.mean(after):.2f} mg"
    because = "what a recording left out changes, structures that do as well, slow instants, measured masses"
    yield f"mass uncertain by the model: {fit.mass_share:.2%} (1 sigma; {because})"
    sigma, mass = max((sigma or 0.0, mass) for sigma, mass in zip(fit.told_shares, after, strict=True))
    yield f"one injection's own pressures tell a mass of {mass:.3g} mg to ±{Z_95 * sigma:.1%} at best (95 %)"


def _arrow(values: Mapping[str, float | None]) -> tuple[str, str, str]:
    return _figure(values["file"]), "->", _figure(values["fitted"])


def _figure(value: float | None) -> str:
    if value is None or math.isnan(value):
        return "-"
    return f"{value:.3g}" if value < 1000.0 else f"{value:.0f}"


def draw_fit(path: Path, done: CalibrationResult) -> None:
    """Write the figure of `fit_figure`; its kind is that of the suffix."""
    with mpl.rc_context(LOOK):
        save_figure(fit_figure(done), path, 110)


def fit_figure(done: CalibrationResult) -> Figure:
    """Draw line pressures before and after, and residuals by phase."""
    before, after = done.comparison.before, done.comparison.after
    shown = spread(range(len(after.folds)), _MOST_OVERLAYS)
    rows = -(-len(shown) // _COLUMNS)
    with mpl.rc_context(LOOK):
        figure = NotebookFigure(figsize=(12.0, 2.9 * rows + 3.6), layout="constrained")
        grid = figure.add_gridspec(rows + 1, _COLUMNS, height_ratios=[1.0] * rows + [1.15])
        for number, fold in enumerate(shown):
            axes = figure.add_subplot(grid[number // _COLUMNS, number % _COLUMNS])
            measurement = after.folds[fold].measurement
            by_file = None if before is None else simulated(measurement, before.models[fold])[0]
            _overlay(axes, measurement, by_file, simulated(measurement, after.models[fold])[0], number == 0)
        _phases(figure.add_subplot(grid[rows, :]), done)
        verdict = verdict_words(done).split(",")[0].split(". ")[0]
        figure.suptitle(f"{done.fitted.structure.name}: {verdict}", fontsize=11)
    return figure


def _overlay(
    axes: Axes, measurement: Measurement, before: SimulatedInjection | None, after: SimulatedInjection, legend: bool
) -> None:
    """The first injection of a fold, with nothing corrected from the opening on."""
    recording, interval = measurement.recording, measurement.interval
    shown = after.samples[: round(_SHOWN_TIME / interval)]
    since = (shown - shown[0]) * interval / MILLISECOND
    axes.plot(since, recording.line_pressure[shown] / MEGAPASCAL, color=MEASURED, lw=0.8, label="measured")
    if before is not None:
        axes.plot(since, before.line_pressure[: shown.size] / MEGAPASCAL, color=GIVEN, lw=1.0, ls="--", label="file")
    axes.plot(since, after.line_pressure[: shown.size] / MEGAPASCAL, color=FOUND, lw=1.0, label="fitted")
    point = point_name(rail_pressure_before(after.event, recording), open_time(after.event, recording))
    axes.set_title(point, fontsize=9)
    axes.set_xlabel("time since opening [ms]")
    axes.set_ylabel("line pressure [MPa]")
    if legend:
        axes.legend(frameon=False, fontsize=8)


def _phases(axes: Axes, done: CalibrationResult) -> None:
    residuals = done.comparison.residuals
    places = np.arange(len(residuals))
    before, after = (np.array([one.chi2[by] for one in residuals], float) for by in ("file", "fitted"))
    both = bool(np.isfinite(before).any())
    if both:
        axes.bar(places - 0.2, before, 0.38, color=GIVEN, label="file")
    axes.bar(places + 0.2 * both, after, 0.38, color=FOUND, label="fitted")
    axes.axhline(1.0, color="#59636e", lw=0.6)
    axes.grid(visible=False, axis="x")
    axes.set_yscale("log")
    axes.set_ylim(_LEAST_CHI2, 1.5 * float(np.nanmax([*before, *after, 1.0])))
    axes.yaxis.set_major_formatter(ScalarFormatter())
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_xticks(places, [f"{one.phase}\n{one.signal.words}" for one in residuals])
    axes.set_ylabel("chi2 (1: noise alone)")
    axes.legend(frameon=False, fontsize=8, loc="upper right")
