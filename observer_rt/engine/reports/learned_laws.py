"""Laws of nozzle and seat as they were learned: curves over each input of the network, and surfaces over two."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from observer_rt.core.model.model import FIRST_OF_SEAT, INPUTS, inputs_along
from observer_rt.engine.estimation.parameters import NOZZLE, SEAT
from observer_rt.engine.estimation.scales import law_probabilities
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.engine.learning.mass import FULL, NEAR, EventPoint, nozzle_change, seat_change
from observer_rt.engine.reports.indicators import SEAT_AREA, SEAT_DROP
from observer_rt.foundation.units import MEGAPASCAL, MILLIMETRE, MILLISECOND, Z_95, Bools, Floats
from observer_rt.model.effective import Coefficients
from observer_rt.model.network import IS_PAIR

_DROP, _AREA, _TIME, _RAIL, _SEAT_DROP = range(INPUTS)  # as the network has them
POINTS = 41  # of a curve
IN_USE = 0.5  # probability of a pair, from which on its surface is shown
LOWEST_DROP = 0.05  # p_0, from which a curve over a pressure drop is stated
LEAST_SPAN = 0.05  # of its middle: a curve over a narrower range of its input says nothing


@dataclass(frozen=True, eq=False)
class LearnedLaw:
    """Relative change of a flow over one input (n,), or two (n, n), others held at those of the last event."""

    flow: str  # name of its indicator
    variables: tuple[str, ...]  # inputs, whose units end the names
    inputs: tuple[Floats, ...]  # (n,) of each
    change: Floats
    half_width: Floats  # of the 95 % interval
    is_seen: Bools  # an event was there
    probability: float  # that the flow goes by this input, or by both at once

    @property
    def is_surface(self) -> bool:
        """Whether it goes by two inputs at once."""
        return len(self.variables) > 1

    @property
    def bend(self) -> float:
        """Largest departure from a level law, in half widths of the interval: up to 1 it may be level."""
        flows = self.half_width > 0.0  # not below the pressure of a chamber
        change, half_width = self.change[flows], self.half_width[flows]
        return float(np.max(np.abs(change - np.average(change, weights=half_width**-2.0)) / half_width))

    @property
    def words(self) -> str:
        """What the law says of the flow, where events were."""
        inputs = " and ".join(variable.rpartition("_")[0].replace("_", " ") for variable in self.variables)
        name, change = "nozzle" if self.flow == NOZZLE else "seat", self.change[self.is_seen]
        span = 100.0 * np.ptp(change) if change.size else 0.0
        return f"learned: {name} flow by {inputs}, {span:.0f} % in all, probability {self.probability:.2f}"

    @property
    def columns(self) -> dict[str, Any]:
        """The law for JSON, and a curve for tables."""
        names, values = list(self.variables), [inputs.tolist() for inputs in self.inputs]
        over = {"variables": names, "values": values, "is_seen": self.is_seen.tolist()}
        return {
            "flow": self.flow,
            **(over if self.is_surface else {"variable": names[0], "value": values[0]}),
            "change": self.change.tolist(),
            "ci95_halfwidth": self.half_width.tolist(),
            "probability": self.probability,
        }


def furthest(laws: Iterable[LearnedLaw]) -> LearnedLaw | None:
    """The curve furthest from level, in units of its interval; None where all may be level."""
    curves = (law for law in laws if not law.is_surface and law.bend > 1.0)
    return max(curves, key=lambda curve: curve.bend, default=None)


def leading(laws: Sequence[LearnedLaw]) -> LearnedLaw | None:
    """The likeliest surface; without any the furthest curve."""
    surfaces = (law for law in laws if law.is_surface)
    return max(surfaces, key=lambda surface: surface.probability, default=furthest(laws))


def learned_laws(knowledge: Knowledge, c: Coefficients) -> tuple[LearnedLaw, ...]:
    """Curves, then surfaces of pairs in use, over the ranges in which there were events; empty before any."""
    learned, theta = knowledge.state.learned, knowledge.in_force
    if not learned.learned_at:
        return ()
    axes, last = _axes(learned.learned_at, c), learned.learned_at[-1]
    held = {_DROP: FULL * last.rail_pressure, _AREA: last.area, _TIME: 0.5 * math.exp(last.log_open_time)}
    held[_RAIL] = last.rail_pressure
    covariance, probabilities, laws = learned.gated.covariance, law_probabilities(learned.belief), []
    for curve in np.argsort(IS_PAIR, kind="stable").tolist():
        swept = [*dict.fromkeys(inputs_along(curve))]
        grids = dict(zip(swept, np.meshgrid(*(axes[number].grid for number in swept), indexing="ij"), strict=True))
        if not grids[swept[0]].size or (IS_PAIR[curve] and probabilities[curve] <= IN_USE):
            continue
        if IS_PAIR[curve] and _RAIL in swept and _DROP not in swept:  # as of a sac that is full
            grids[_DROP] = FULL * grids[_RAIL]
        if curve < FIRST_OF_SEAT:
            drop, seat, since, rail = np.broadcast_arrays(*(held | grids).values())
            change, slopes = nozzle_change(theta, np.stack((drop, 0.0 * drop, drop)), (rail, seat), since)
        else:
            change, slopes = seat_change(theta, grids.get(_AREA, SEAT_AREA), grids.get(_SEAT_DROP, SEAT_DROP))
        seen = [axes[number].is_seen for number in swept]
        laws.append(
            LearnedLaw(
                NOZZLE if curve < FIRST_OF_SEAT else SEAT,
                tuple(axes[number].variable for number in swept),
                tuple(axes[number].unit * axes[number].grid + axes[number].origin for number in swept),
                change,
                Z_95 * np.sqrt(((slopes @ covariance) * slopes).sum(axis=-1)),
                np.einsum("ei,ej->ij", *seen) if IS_PAIR[curve] else np.logical_or.reduce(seen[0]),
                float(probabilities[curve]),
            )
        )
    return tuple(laws)


class _Axis(NamedTuple):
    variable: str
    unit: float  # of the network's units, in those of the variable
    origin: float  # 0 of the network, in the units of the variable
    grid: Floats  # (n,) in the network's units
    reached: Floats  # (events, 2) from where to where each went

    @property
    def is_seen(self) -> Bools:
        """(events, n): which of them reached which values."""
        return (self.reached[:, :1] <= self.grid) & (self.grid <= self.reached[:, 1:])


def _axes(points: Sequence[EventPoint], c: Coefficients) -> tuple[_Axis, ...]:
    pressure, area = c.pressure_scale / MEGAPASCAL, c.area_scale / MILLIMETRE**2
    rails, logs, areas = np.array(points).T
    times = np.exp(logs)

    def axis(variable: str, unit: float, grid: Floats, reach: Floats) -> _Axis:
        return _Axis(variable, unit, 0.0, grid, np.column_stack((0.0 * reach, reach)))

    around, chamber = rails[:, None] + (-NEAR, NEAR), c.chamber_pressure / MEGAPASCAL
    return (
        axis("pressure_drop_MPa", pressure, _grid(LOWEST_DROP, FULL * rails.max()), FULL * rails),
        axis("seat_area_mm2", area, _grid(0.1 * areas.max(), areas.max()), areas),
        axis("time_since_opening_ms", 1.0 / MILLISECOND, _grid(0.1 * times.max(), times.max()), times),
        _Axis("rail_pressure_MPa", pressure, chamber, _grid(rails.min(), rails.max()), around),
        axis("pressure_drop_MPa", pressure, _grid(LOWEST_DROP, rails.max()), rails),
    )


def _grid(first: float, last: float) -> Floats:
    """Inputs (n,) of a curve, empty where the range is too narrow."""
    if last - first < LEAST_SPAN * 0.5 * (first + last):
        return np.empty(0)
    return np.linspace(first, last, POINTS)
