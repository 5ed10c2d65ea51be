"""Line against rail pressure: gains of their sensors that differ, and an offset that moves from event to event."""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.gating import Belief
from observer_rt.engine.estimation.scalars import Parameter
from observer_rt.engine.learning.memory import Count

REMEMBERED = 0.9  # weight of the events before an event
ENOUGH = 4.0  # events by these weights, before a gain is spoken of: five
SIGNIFICANT = 6.0  # standard deviations, of few events
LEAST_GAIN = 0.002
LEAST_SPREAD = 0.05  # of the rail pressure, standard deviation [p_0]: else its own drift looks like a gain
NOISE = 3e-4  # of an offset, in units of p_0, at least
# Share by which gains may differ: the level of the flow is no better known than by half of it.
LARGEST_GAIN = 0.015
FLOW_SHARE = 0.4  # of the difference, what the flow is unsure by: half of it at the most
# An offset that was seen at one pressure may be a gain of the line sensor in whole, as flows see it.
UNTOLD_SHARE = 0.6
SEAT_SHARE = 2.0  # v_S is as much less certain than v_H


@dataclass(frozen=True, eq=False)
class PressureGains:
    """Offsets found in recent events over their pressures: what of them grows with the pressure is of the gains.

    From a line and a rail pressure alone it is not known whose gain is wrong: half of the difference is taken for the
    line sensor's, so that flows are wrong by half of it at the most, whoever's it is. difference: by which the gain
    of the line sensor is larger (share), 0 while nothing tells; change: of it, by the last event; seen: offset of
    that over its rail pressure; pressure: that; moves: events in a row that moved the offset, as a gain that is not
    known yet makes it.
    """

    sums: NDArray[np.float64] = field(default_factory=lambda: np.zeros(6))
    difference: float = 0.0
    seen: float = 0.0
    change: float = 0.0
    pressure: float = 0.0
    moves: Count = 0

    def after(self, offset: float, pressure: float, has_moved: bool = False) -> "PressureGains":
        """Adds an event's line over rail pressure, as recorded, and its rail pressure [p_0].

        has_moved: the offset, which says nothing of what it was before.
        """
        o, p = offset, pressure
        kept = REMEMBERED if self.moves or not has_moved else 0.0
        sums = kept * self.sums + np.array([1.0, p, o, p * p, p * o, o * o])
        moves = self.moves + 1 if has_moved else 0
        difference = _difference_in(sums)
        seen = abs(offset) / pressure if pressure > 0.0 else 0.0
        return PressureGains(sums, difference, seen, difference - self.difference, p, moves)

    def as_recorded(self, offset: float, pressure: float) -> float:
        """Line over rail pressure as recorded, where it is `offset` after the line's share is undone."""
        return offset + 0.5 * self.difference * pressure

    def undone(self, line_pressure: NDArray[np.float64]) -> NDArray[np.float64]:
        """The line pressure without its share of the gains' difference."""
        return line_pressure / (1.0 + 0.5 * self.difference)

    def undone_offset(self, offset: float, pressure: float) -> float:
        """The offset that is left of one as recorded."""
        return offset - 0.5 * self.difference * pressure

    @property
    def is_too_large(self) -> bool:
        """Whether the level of flows depends on whose gain is wrong, also where that is seen by the offset only."""
        seen = self.seen if self.moves > 1 else 0.0
        return max(abs(self.difference), seen) > LARGEST_GAIN

    @property
    def flow_share(self) -> float:
        """Standard deviation of flows, as a share, by what is not known of the gains."""
        return FLOW_SHARE * max(abs(self.difference), self.seen if self.moves else 0.0)

    def wear_variance(self, width: int) -> NDArray[np.float64]:
        """Variances (width,) of theta's wear by the gains: an offset may be a gain where none was stated."""
        share = self.flow_share if self.difference else UNTOLD_SHARE * self.seen
        return _of_wear(share, width) ** 2

    def move_to(self, pressure: float) -> float:
        """Move of the offset [p_0] that is left of a sensor at another rail pressure, by the rail's share."""
        return 0.5 * self.difference * (pressure - self.pressure)

    def rescaled(self, belief: Belief) -> Belief:
        """Belief about flows after the last event changed what is undone, less sure by as much."""
        change = self.change
        if change == 0.0:
            return belief
        mean = belief.mean.copy()
        mean[Parameter.NOZZLE_BIAS] -= 0.5 * change * (1.0 + mean[Parameter.NOZZLE_BIAS])
        return replace(belief, mean=mean).widened(_of_wear(0.5 * change, mean.size))


def _difference_in(sums: NDArray[np.float64]) -> float:
    """Growth of the offsets with the pressure, by their weighted sums (6,)."""
    count = sums[0]
    if count < ENOUGH:
        return 0.0
    p, o, pp, po, oo = sums[1:] / count
    spread = pp - p * p
    if not spread > LEAST_SPREAD**2:
        return 0.0
    gain = (po - p * o) / spread
    rest = max(oo - o * o - gain * (po - p * o), NOISE**2) * count / (count - 2.0)
    sigma = math.sqrt(rest / (count * spread))
    return float(gain) if abs(gain) > max(SIGNIFICANT * sigma, LEAST_GAIN) else 0.0


def _of_wear(share: float, width: int) -> NDArray[np.float64]:
    result = np.zeros(width)
    result[Parameter.NOZZLE_BIAS] = share
    result[Parameter.SEAT_BIAS] = SEAT_SHARE * share
    return result
