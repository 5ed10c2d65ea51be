"""Laws of nozzle and seat as they were learned: curves over each input of the network, and surfaces over two."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.model.model import FIRST_OF_SEAT, INPUTS, inputs_along
from observer_rt.engine.estimation.scalars import NOZZLE, SEAT
from observer_rt.engine.learning.indicators import SEAT_AREA, SEAT_DROP, nozzle_change, seat_change
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.engine.learning.learned_range import FULL, NEAR, EventPoint
from observer_rt.engine.learning.scales import law_probabilities
from observer_rt.foundation.units import MEGAPASCAL, MILLIMETRE, MILLISECOND, Z_95
from observer_rt.model.effective import Coefficients
from observer_rt.model.network import IS_PAIR

_DROP, _AREA, _TIME, _RAIL, _SEAT_DROP = range(INPUTS)  # as the network has them
POINTS = 41  # of a curve
IN_USE = 0.5  # probability of a pair, from which on its surface is shown
LOWEST_DROP = 0.05  # p_0, from which a curve over a pressure drop is stated
LEAST_SPAN = 0.05  # of its middle: a curve over a narrower range of its input says nothing


@dataclass(frozen=True, eq=False)
class LearnedCurve:
    """Relative change of a flow over one input, the other inputs held at those of the last event.

    flow: name of its indicator; variable: the input, whose unit ends the name; inputs, change and half_width (of the
    95 % interval): (n,) each; probability: that the flow goes by this input.
    """

    flow: str
    variable: str
    inputs: NDArray[np.float64]
    change: NDArray[np.float64]
    half_width: NDArray[np.float64]
    probability: float

    @property
    def bend(self) -> float:
        """Largest departure from a level curve, in half widths of the interval: up to 1 it may be level."""
        level = np.average(self.change, weights=self.half_width**-2.0)
        return float(np.max(np.abs(self.change - level) / self.half_width))

    @property
    def words(self) -> str:
        """What the curve says of the flow."""
        return _law_words(self.flow, (self.variable,), self.change, self.probability)

    @property
    def columns(self) -> dict[str, Any]:
        """The curve for JSON, and for tables."""
        return _columns(self, variable=self.variable, value=self.inputs.tolist())


def furthest(curves: Iterable[LearnedCurve]) -> LearnedCurve | None:
    """The curve furthest from level, in units of its interval; None where all may be level."""
    return max((curve for curve in curves if curve.bend > 1.0), key=lambda curve: curve.bend, default=None)


@dataclass(frozen=True, eq=False)
class LearnedSurface:
    """Relative change of a flow over two inputs, the others held as for curves.

    flow: name of its indicator; variables: the inputs; inputs: (n,) of each; change, half_width (of the 95 %
    interval), is_seen (an event was there): (n, n) each, by the first input and the second; probability: that the
    flow goes by both at once.
    """

    flow: str
    variables: tuple[str, ...]
    inputs: tuple[NDArray[np.float64], ...]
    change: NDArray[np.float64]
    half_width: NDArray[np.float64]
    is_seen: NDArray[np.bool_]
    probability: float

    @property
    def words(self) -> str:
        """What the surface says of the flow, where events were."""
        return _law_words(self.flow, self.variables, self.change[self.is_seen], self.probability)

    @property
    def columns(self) -> dict[str, Any]:
        """The surface for JSON."""
        values = [inputs.tolist() for inputs in self.inputs]
        return _columns(self, variables=list(self.variables), values=values, is_seen=self.is_seen.tolist())


def _columns(law: LearnedCurve | LearnedSurface, **over: Any) -> dict[str, Any]:
    """A law for JSON; over: its inputs."""
    change, half_width = law.change.tolist(), law.half_width.tolist()
    return {"flow": law.flow, **over, "change": change, "ci95_halfwidth": half_width, "probability": law.probability}


def _law_words(flow: str, variables: Iterable[str], change: NDArray[np.float64], probability: float) -> str:
    inputs = " and ".join(variable.rpartition("_")[0].replace("_", " ") for variable in variables)
    name, span = "nozzle" if flow == NOZZLE else "seat", 100.0 * np.ptp(change) if change.size else 0.0
    return f"learned: {name} flow by {inputs}, {span:.0f} % in all, probability {probability:.2f}"


def learned_curves(knowledge: Knowledge, c: Coefficients) -> tuple[LearnedCurve, ...]:
    """Curves of what was learned, over the ranges in which there were events; none before any."""
    return tuple(
        LearnedCurve(flow, axis.variable, axis.unit * axis.grid + axis.origin, change, half_width, probability)
        for flow, (axis,), change, half_width, probability in _laws(knowledge, c, ~IS_PAIR)
    )


def learned_surfaces(knowledge: Knowledge, c: Coefficients) -> tuple[LearnedSurface, ...]:
    """Surfaces of the pairs that are rather in use than not."""
    is_in_use = IS_PAIR & (law_probabilities(knowledge.state.learned.belief) > IN_USE)
    return tuple(
        LearnedSurface(
            flow,
            tuple(axis.variable for axis in axes),
            tuple(axis.unit * axis.grid + axis.origin for axis in axes),
            change,
            half_width,
            (axes[0].is_seen[:, :, None] & axes[1].is_seen[:, None, :]).any(axis=0),
            probability,
        )
        for flow, axes, change, half_width, probability in _laws(knowledge, c, is_in_use)
    )


class _Axis(NamedTuple):
    """An input of the network: its variable; its grid (n,) in the network's units, and what these are in its own.

    reached: (events, 2), from where to where each went.
    """

    variable: str
    unit: float
    origin: float
    grid: NDArray[np.float64]
    reached: NDArray[np.float64]

    @property
    def is_seen(self) -> NDArray[np.bool_]:
        """(events, n): which of them reached which values."""
        return (self.reached[:, :1] <= self.grid) & (self.grid <= self.reached[:, 1:])


def _laws(knowledge: Knowledge, c: Coefficients, which: NDArray[np.bool_]) -> Iterator[tuple[Any, ...]]:
    """Flow, axes, change, half width and probability of curves of the network over their one or two inputs."""
    learned, theta = knowledge.state.learned, knowledge.in_force
    if not learned.learned_at:
        return
    axes, last = _axes(learned.learned_at, c), learned.learned_at[-1]
    half = 0.5 * math.exp(last.open_time)
    held = {_DROP: FULL * last.rail_pressure, _AREA: last.area, _TIME: half, _RAIL: last.rail_pressure}
    covariance, probabilities = learned.gated.covariance, law_probabilities(learned.belief)
    for curve in np.flatnonzero(which).tolist():
        swept = [*dict.fromkeys(inputs_along(curve))]
        grids = dict(zip(swept, np.meshgrid(*(axes[number].grid for number in swept), indexing="ij"), strict=True))
        if not grids[swept[0]].size:
            continue
        if swept == [
            _RAIL,
            _TIME,
        ]:  # as in a sac that is full: no event tells the rail pressure's doing from the drop's
            grids[_DROP] = FULL * grids[_RAIL]
        if curve < FIRST_OF_SEAT:
            drop, seat, since, rail = np.broadcast_arrays(*(held | grids).values())
            change, slopes = nozzle_change(theta, np.stack((drop, 0.0 * drop, drop)), (rail, seat), since)
        else:
            change, slopes = seat_change(theta, grids.get(_AREA, SEAT_AREA), grids.get(_SEAT_DROP, SEAT_DROP))
        half_width = Z_95 * np.sqrt(((slopes @ covariance) * slopes).sum(axis=-1))
        flow = NOZZLE if curve < FIRST_OF_SEAT else SEAT
        yield flow, [axes[number] for number in swept], change, half_width, float(probabilities[curve])


def _axes(points: Sequence[EventPoint], c: Coefficients) -> tuple[_Axis, ...]:
    """Inputs in the order in which the network has them."""
    pressure, area = c.pressure_scale / MEGAPASCAL, c.area_scale / MILLIMETRE**2
    rails, logs, areas = np.array(points).T
    times = np.exp(logs)

    def axis(variable: str, unit: float, grid: NDArray[np.float64], reach: NDArray[np.float64]) -> _Axis:
        return _Axis(variable, unit, 0.0, grid, np.column_stack((0.0 * reach, reach)))

    around, chamber = rails[:, None] + (-NEAR, NEAR), c.chamber_pressure / MEGAPASCAL
    return (
        axis("pressure_drop_MPa", pressure, _grid(LOWEST_DROP, FULL * rails.max()), FULL * rails),
        axis("seat_area_mm2", area, _grid(0.1 * areas.max(), areas.max()), areas),
        axis("time_since_opening_ms", 1.0 / MILLISECOND, _grid(0.1 * times.max(), times.max()), times),
        _Axis("rail_pressure_MPa", pressure, chamber, _grid(rails.min(), rails.max()), around),
        axis("pressure_drop_MPa", pressure, _grid(LOWEST_DROP, rails.max()), rails),
    )


def _grid(first: float, last: float) -> NDArray[np.float64]:
    """Inputs of a curve (n,), none where the range is too narrow."""
    if last - first < LEAST_SPAN * 0.5 * (first + last):
        return np.empty(0)
    return np.linspace(first, last, POINTS)
