"""A fit to a map of masses on the screen, and as a figure."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from rich.console import Console

from observer_rt.desk.injection_map.map_document import MapDocument, verdict_words
from observer_rt.desk.injection_map.map_fit import MapFit
from observer_rt.desk.injection_map.simulated_masses import masses_of
from observer_rt.foundation.console import plain_table, say
from observer_rt.foundation.figures import LOOK, NotebookFigure, save_figure
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MILLISECOND, Z_95
from observer_rt.identification.fit.report import parameter_table

TICKS = (0.1, 0.2, 0.3, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0)  # ms of a figure
CURVE_POINTS = 24  # durations at which a figure's curves are simulated


def print_map_fit(document: MapDocument, console: Console) -> None:
    say(console, "parameters")
    console.print(parameter_table(document.parameters))
    if document.undetermined:
        names = ", ".join(document.undetermined)
        say(console, f"masses tell little of {names}: they stay near the file's, with intervals that say so")
    say(console, "\nmasses [mg], measured and fitted")
    points = [
        (
            f"{point.rail_pressure_MPa:g}",
            f"{point.energizing_ms:g}",
            f"{point.mass_mg:.2f}",
            f"{point.fitted_mg:.2f}",
            f"{point.off_sigmas:+.1f}",
        )
        for point in document.points
    ]
    console.print(plain_table(("MPa", "ms", "measured", "fitted", "sigmas"), points, right=range(5), folds=()))
    say(console, f"\nverdict: {document.verdict_words}")


def draw_map_fit(path: Path, done: MapFit) -> None:
    """Write the figure of `map_figure`; its kind is that of the suffix."""
    save_figure(map_figure(done), path, 110)


def map_figure(done: MapFit) -> Figure:
    """Draw masses over energizing times, measured and by the model, and their differences in standard deviations."""
    of = done.map
    with mpl.rc_context(LOOK):
        figure = NotebookFigure(figsize=(8.0, 5.6), layout="constrained")
        masses, differences = figure.subplots(2, sharex=True, height_ratios=[2.5, 1.0])
        pressures = np.unique(of.rail_pressure)
        durations = np.geomspace(of.energizing.min(), of.energizing.max(), CURVE_POINTS)
        colours = mpl.colormaps["viridis"](np.linspace(0.0, 0.85, pressures.size))
        for pressure, colour in zip(pressures, colours, strict=True):
            curve = masses_of(done.injector, np.full(durations.size, pressure), durations)
            masses.plot(durations / MILLISECOND, curve / MILLIGRAM, color=colour, lw=1.0)
            at = of.rail_pressure == pressure
            times, bars = of.energizing[at] / MILLISECOND, Z_95 * of.sigma[at] / MILLIGRAM
            look = {"color": colour, "ms": 4.0, "label": f"{pressure / MEGAPASCAL:g} MPa"}
            masses.errorbar(times, of.mass[at] / MILLIGRAM, bars, fmt="o", elinewidth=0.8, **look)
            differences.plot(times, done.off[at], "o", **look)
        masses.set_ylabel("mass [mg]")
        masses.legend(frameon=False, title="rail pressure")
        differences.axhspan(-Z_95, Z_95, color="#dfe5ea")
        differences.set_ylabel("fitted less measured\n[standard deviations]")
        differences.set_xlabel("energizing time [ms]")
        differences.set_xscale("log")
        ticks = [tick for tick in TICKS if durations[0] <= 1.2e-3 * tick and 0.8e-3 * tick <= durations[-1]]
        differences.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        differences.minorticks_off()
        figure.suptitle(verdict_words(done).split(". ")[0], fontsize=10)
    return figure
