"""Faults that are not the same all through an injection, as a sequence of such that are.

Imports nothing of `observer_rt`.
"""

from tools.benchmarks.arrays import Array
from tools.benchmarks.plant_parameters import Faults

HOLE_CLOSES = 0.6e-3  # s after an opening


def phases_of(faults: Faults, strokes: Array) -> tuple[tuple[float, Faults], ...]:
    """When [s] which faults come into force within an event, after those of its beginning, in order.

    strokes (m, 6): as of `plant_equations.lift_at`.
    """
    changing = faults.hole_closing != 0.0 or faults.seat_hysteresis != 0.0
    return tuple(phase for stroke in strokes for phase in _of_opening(faults, stroke)) if changing else ()


def _of_opening(faults: Faults, stroke: Array) -> list[tuple[float, Faults]]:
    opening, _, closing, closed = (float(moment) for moment in stroke[:4])
    late = opening + HOLE_CLOSES
    phases = []
    for moment in sorted((late, closing)):
        now = faults
        if moment >= late:
            now = now._replace(orifice_area=(1.0 + now.orifice_area) * (1.0 - now.hole_closing) - 1.0)
        if moment >= closing:
            now = now._replace(seat_lift_loss=now.seat_lift_loss - now.seat_hysteresis)
        if moment < closed:
            phases.append((moment, now))
    return [*phases, (closed, faults)]
