"""A fit to a map of masses as a document, on the screen, as a figure, and as an injector file."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from pydantic import Field
from rich.console import Console

from observer_rt.config.injector_file import InjectorFile
from observer_rt.desk.injection_map.map_fit import MapFit, masses_of
from observer_rt.desk.injection_map.mass_map import MassMap
from observer_rt.foundation.console import plain_table, say
from observer_rt.foundation.documents import Document, DocumentPart
from observer_rt.foundation.figures import LOOK, NotebookFigure, save_figure
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MILLISECOND, Z_95
from observer_rt.identification.fit.fitted_file import BASELINE, set_numbers
from observer_rt.identification.fit.forms import FittedNumber
from observer_rt.identification.fit.report import parameter_table

DIFFERENCE = "needle.closing_delay less opening_delay"
FAR = 3.0  # standard deviations of the map, spread included, from which on a point is named
TICKS = (0.1, 0.2, 0.3, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0)  # ms of a figure
CURVE_POINTS = 24  # durations at which a figure's curves are simulated
_NAMED = 5  # points that a verdict names at most


class MapPoint(DocumentPart):
    """A point of the map; off_sigmas: of the model's mass from the measured one, in the map's standard deviations."""

    rail_pressure_MPa: float  # noqa: N815 - units as printed
    energizing_ms: float
    mass_mg: float
    fitted_mg: float
    off_sigmas: float


class MapDocument(Document):
    """Result of `observer-rt fit --map`."""

    verdict_words: str
    parameters: dict[str, FittedNumber]
    undetermined: tuple[str, ...] = Field(description="parameters that masses by themselves tell little of")
    rms_percent: float = Field(description="of the masses, weighed by their standard deviations")
    spread: float = Field(
        description="variance of the differences over that of the map, 1 at least; in the intervals"
    )
    points: tuple[MapPoint, ...]


def document_of(done: MapFit) -> MapDocument:
    """Puts a fit into printed units."""
    return MapDocument(
        schema=1,
        verdict_words=verdict_words(done),
        parameters={**done.sizes, DIFFERENCE: done.delay_difference},
        undetermined=done.undetermined,
        rms_percent=100.0 * done.rms,
        spread=done.spread,
        points=tuple(_points(done)),
    )


def _points(done: MapFit) -> Iterator[MapPoint]:
    of = done.map
    columns = (of.rail_pressure, of.energizing, of.mass, done.masses, done.off)
    for pressure, energizing, mass, fitted, off in zip(*(column.tolist() for column in columns), strict=True):
        yield MapPoint(
            rail_pressure_MPa=pressure / MEGAPASCAL,
            energizing_ms=energizing / MILLISECOND,
            mass_mg=mass / MILLIGRAM,
            fitted_mg=fitted / MILLIGRAM,
            off_sigmas=off,
        )


def verdict_words(done: MapFit) -> str:
    """How well the injector explains its map, and where not."""
    far = [point for point in _points(done) if abs(point.off_sigmas) > FAR * done.spread**0.5]
    far.sort(key=lambda point: -abs(point.off_sigmas))
    words = f"{done.map.mass.size} masses explained to {done.rms:.1%} (rms, weighed)"
    if done.spread > 1.0:
        words += f", {done.spread**0.5:.1f} times what the map's uncertainties allow, which is in the intervals"
    if far:
        named = (
            f"{point.rail_pressure_MPa:g} MPa, {point.energizing_ms:g} ms ({point.fitted_mg - point.mass_mg:+.2g} mg)"
            for point in far[:_NAMED]
        )
        words += f". Not explained, the worst first: {'; '.join(named)}"
    return words


def print_map_fit(document: MapDocument, console: Console) -> None:
    """Numbers, points and verdict."""
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


def write_map_fit(path: Path, file: InjectorFile, done: MapFit) -> None:
    """Write the injector file with the fitted numbers, without a section on recordings of a fit before."""
    with file.changed(path) as document:
        content: Any = document
        content.pop(BASELINE, None)
        set_numbers(content, done.written, done.injector)


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
        for pressure, colour in zip(
            pressures, mpl.colormaps["viridis"](np.linspace(0.0, 0.85, pressures.size)), strict=True
        ):
            curve = MassMap(np.full(durations.size, pressure), durations, durations, durations)
            masses.plot(durations / MILLISECOND, masses_of(done.injector, curve) / MILLIGRAM, color=colour, lw=1.0)
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
