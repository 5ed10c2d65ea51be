"""The document of a fit to a map of masses, which `--json` writes and the screen shows, and its injector file."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import Field

from observer_rt.config.injector_file import InjectorFile
from observer_rt.desk.injection_map.map_fit import MapFit
from observer_rt.foundation.documents import Document, DocumentPart
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MILLISECOND
from observer_rt.identification.fit.fitted_file import BASELINE, set_numbers
from observer_rt.identification.fit.forms import FittedNumber

DIFFERENCE = "needle.closing_delay less opening_delay"
NOTEWORTHY = 1.2  # times the uncertainties of a map, from which on their scatter is said
FAR = 3.0  # standard deviations of the map, spread included, from which on a point is named
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
    spread: float = Field(description="variance of the differences over that of the map, 1 at least; in intervals")
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
    if (times := math.sqrt(done.spread)) > NOTEWORTHY:
        words += f", {times:.1f} times what the map's uncertainties allow, which is in the intervals"
    if far:
        named = (
            f"{point.rail_pressure_MPa:g} MPa, {point.energizing_ms:g} ms ({point.fitted_mg - point.mass_mg:+.2g} mg)"
            for point in far[:_NAMED]
        )
        words += f". Not explained, the worst first: {'; '.join(named)}"
    return words


def write_map_fit(path: Path, file: InjectorFile, done: MapFit) -> None:
    """Write the injector file with the fitted numbers, without a section on recordings of a fit before."""
    with file.changed(path) as document:
        content: Any = document
        content.pop(BASELINE, None)
        set_numbers(content, done.written, done.injector)
