"""Laws of nozzle and seat as they were learned: curves over each input of the network, with their intervals."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.model.model import FIRST_OF_SEAT
from observer_rt.engine.estimation.scalars import NOZZLE, SEAT
from observer_rt.engine.learning.indicators import SEAT_AREA, SEAT_DROP, nozzle_change, seat_change
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.engine.learning.learned_range import FULL, EventPoint
from observer_rt.engine.learning.scales import law_probabilities
from observer_rt.foundation.units import MEGAPASCAL, MILLIMETRE, MILLISECOND, Z_95
from observer_rt.model.effective import Coefficients

SEAT_BY_AREA, SEAT_BY_DROP = FIRST_OF_SEAT, FIRST_OF_SEAT + 1  # numbers of its curves in the network
POINTS = 41  # of a curve
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
        variable, span = self.variable.rpartition("_")[0].replace("_", " "), 100.0 * np.ptp(self.change)
        flow = "nozzle" if self.flow == NOZZLE else "seat"
        return f"learned: {flow} flow by {variable}, {span:.0f} % in all, probability {self.probability:.2f}"

    @property
    def columns(self) -> dict[str, Any]:
        """The curve for JSON, and for tables."""
        return {
            "flow": self.flow,
            "variable": self.variable,
            "value": self.inputs.tolist(),
            "change": self.change.tolist(),
            "ci95_halfwidth": self.half_width.tolist(),
            "probability": self.probability,
        }


def furthest(curves: Iterable[LearnedCurve]) -> LearnedCurve | None:
    """The curve furthest from level, in units of its interval; None where all may be level."""
    return max((curve for curve in curves if curve.bend > 1.0), key=lambda curve: curve.bend, default=None)


def learned_curves(knowledge: Knowledge, c: Coefficients) -> tuple[LearnedCurve, ...]:
    """Curves of what was learned, over the ranges in which there were events; none before any."""
    learned, theta = knowledge.state.learned, knowledge.in_force
    covariance, probabilities = learned.gated.covariance, law_probabilities(learned.belief)
    return tuple(
        LearnedCurve(
            flow,
            variable,
            inputs,
            change,
            Z_95 * np.sqrt(((slopes @ covariance) * slopes).sum(1)),
            float(probabilities[curve]),
        )
        for curve, flow, variable, inputs, change, slopes in _changes(theta, learned.learned_at, c)
    )


def _changes(theta: NDArray[np.float64], points: Sequence[EventPoint], c: Coefficients) -> Iterator[tuple[Any, ...]]:
    """Number, flow, variable, inputs (n,), change (n,) and its slopes by theta (n, m) of every curve."""
    if not points:
        return
    last, pressure, area = points[-1], c.pressure_scale / MEGAPASCAL, c.area_scale / MILLIMETRE**2
    rails, widest = [point.rail_pressure for point in points], max(point.area for point in points)
    longest = max(math.exp(point.open_time) for point in points)
    grids = (
        ("pressure_drop_MPa", pressure, 0.0, _grid(LOWEST_DROP, FULL * max(rails))),
        ("seat_area_mm2", area, 0.0, _grid(0.1 * widest, widest)),
        ("time_since_opening_ms", 1.0 / MILLISECOND, 0.0, _grid(0.1 * longest, longest)),
        ("rail_pressure_MPa", pressure, c.chamber_pressure / MEGAPASCAL, _grid(min(rails), max(rails))),
    )
    held = (FULL * last.rail_pressure, last.area, 0.5 * math.exp(last.open_time), last.rail_pressure)
    for swept, (variable, unit, origin, grid) in enumerate(grids):
        drop, seat, since, rail = (grid if swept == k else np.full_like(grid, held[k]) for k in range(4))
        if grid.size:
            states = np.stack((drop, 0.0 * drop, drop))
            yield swept, NOZZLE, variable, unit * grid + origin, *nozzle_change(theta, states, (rail, seat), since)
    drops, areas = _grid(LOWEST_DROP, max(rails)), grids[1][-1]
    yield SEAT_BY_AREA, SEAT, "seat_area_mm2", areas * area, *seat_change(theta, areas, SEAT_DROP)
    yield SEAT_BY_DROP, SEAT, "pressure_drop_MPa", drops * pressure, *seat_change(theta, SEAT_AREA, drops)


def _grid(first: float, last: float) -> NDArray[np.float64]:
    """Inputs of a curve (n,), none where the range is too narrow."""
    if last - first < LEAST_SPAN * 0.5 * (first + last):
        return np.empty(0)
    return np.linspace(first, last, POINTS)
