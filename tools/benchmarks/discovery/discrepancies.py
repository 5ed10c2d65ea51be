"""Discrepancies of plants that no parameter of the model takes up. Imports nothing of `observer_rt`."""

import zlib
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from tests.plants.filters import filtered, resonance
from tests.plants.parameters import Injector
from tests.plants.plant import LINE, Step, seen_as
from tests.plants.rail import MovingRail, drawn_rail
from tests.plants.wave import LINES, Variant, WaveLine, real_part
from tools.benchmarks.cases import sign

LENGTH_CHANGE = 0.02
TAPERS = (0.15, 0.25)
END_SHARES = (0.03, 0.06)  # of the line's volume in the gallery
INLET_RATIOS = (1.5, 3.0)  # area of the line's first element to that of the others
INLET_LOSSES = (1e14, 3e14)  # Pa s2/m6: 0.25 to 0.75 MPa at 50 mm3/ms
MOUNTING_FREQUENCIES = (18e3, 30e3)  # Hz
MOUNTING_DAMPINGS = (0.1, 0.3)


class Discrepancy(StrEnum):
    """What sets a plant apart from every model, beside its discretisation; all rails move."""

    PLAIN = "plain"
    LENGTH = "length"  # another one than the injector file says
    TAPER = "taper"  # of the line's area
    END_VOLUMES = "end_volumes"  # a room and an orifice behind the rail, a larger gallery before the seat
    FRICTION = "friction"  # depends on frequency
    MOUNTING = "mounting"  # of the line-pressure sensor, in a hole that resonates
    STEP = "step"  # of the line's area


@dataclass(frozen=True)
class Plant:
    """A real injector with its line, its rail, and what its line-pressure sensor's mounting does to the signal."""

    part: Injector
    line: WaveLine
    rail: MovingRail
    mounting: tuple[Step, ...] = ()


def plant_of(discrepancy: Discrepancy, seed: int) -> Plant:
    """The plant with a discrepancy and a seed, from which all else of it is drawn."""
    rng = np.random.default_rng([seed, zlib.crc32(discrepancy.encode())])
    part, rail = real_part(int(rng.integers(2**62))), drawn_rail(rng)
    plant = Plant(part, LINES[Variant.PLAIN], rail)
    match discrepancy:
        case Discrepancy.LENGTH:
            return replace(plant, part=_of_length(part, 1.0 + LENGTH_CHANGE * sign(rng)))
        case Discrepancy.TAPER:
            return replace(plant, line=plant.line._replace(taper=sign(rng) * rng.uniform(*TAPERS)))
        case Discrepancy.END_VOLUMES:
            share, ratio, loss = (rng.uniform(*each) for each in (END_SHARES, INLET_RATIOS, INLET_LOSSES))
            return replace(plant, line=plant.line._replace(end_share=share, inlet_ratio=ratio, inlet_loss=loss))
        case Discrepancy.PLAIN | Discrepancy.FRICTION | Discrepancy.STEP:
            return replace(plant, line=LINES[Variant(discrepancy)])
        case Discrepancy.MOUNTING:
            frequency, damping = rng.uniform(*MOUNTING_FREQUENCIES), rng.uniform(*MOUNTING_DAMPINGS)
            return replace(plant, mounting=(resonant_line(frequency, damping),))


def resonant_line(frequency: float, damping: float) -> Step:
    """A line-pressure sensor behind something that resonates [Hz]."""
    response = resonance(frequency, damping)
    return seen_as(LINE, lambda time, p: filtered(p, float(time[1] - time[0]), response))


def _of_length(part: Injector, factor: float) -> Injector:
    """The part with a longer pipe; rooms at its ends, which the line's volume counts too, stay."""
    return part._replace(
        line_length=part.line_length * factor,
        line_volume=part.line_volume + part.line_area * part.line_length * (factor - 1.0),
        line_loss=part.line_loss * factor,
    )
