"""The range in which recordings show a law: between the ends of what its inputs were there, and a margin."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.units import MEGAPASCAL, MILLIMETRE, MILLISECOND, MM3_PER_MS
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.identification.likelihood.open_loop import simulated
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.terms.in_force import SeenRange
from observer_rt.model.terms.variable import VARIABLES, Variable

MARGIN = 0.1  # of the range of a pressure or speed, at both ends
FLOW_MARGIN = 1.25  # times the largest injection rate, that a flow may be, either way
_DIGITS = 4
_RATE = {
    "rail_pressure": "rail_pressure_rate",
    "line_pressure": "line_pressure_rate",
    "needle_lift": "lift_rate",
}


def seen_in(measured: Sequence[Measurement], model: EffectiveModel) -> SeenRange:
    """Ranges of pressures, flows, speeds and what counts from an opening or the start, in the units of laws."""
    events = [(one, event) for one in measured for event in one.events]
    ranges = {
        Variable.INJECTION_NUMBER: (1.0, float(max(e.clock.injections + len(e.openings) for _, e in events)))
    }
    ranges[Variable.TIME] = (0.0, max(e.clock.time + (e.end - e.start) * one.interval for one, e in events))
    since = max((e.end - e.openings[-1].first) * one.interval for one, e in events)
    ranges[Variable.TIME_SINCE_OPENING] = (0.0, since / MILLISECOND)
    for name, unit in (
        ("rail_pressure", MEGAPASCAL),
        ("line_pressure", MEGAPASCAL),
        ("needle_lift", MILLIMETRE),
    ):
        values = [getattr(one.recording, name)[e.start : e.end] / unit for one, e in events]
        changes = [
            np.diff(each) * (MILLISECOND / one.interval)
            for each, (one, _) in zip(values, events, strict=True)
        ]
        ranges[VARIABLES[_RATE[name]]] = _widened(changes)
        low, high = _widened(values)
        ranges[VARIABLES[name]] = max(low, 0.0), high
    del ranges[Variable.NEEDLE_LIFT]  # which may be anywhere up to its stop
    ranges[Variable.SAC_PRESSURE] = 0.0, ranges[Variable.LINE_PRESSURE][1]
    flow = FLOW_MARGIN * max(float(np.max(run.rate)) for one in measured for run in simulated(one, model))
    for variable in (Variable.LINE_FLOW, Variable.SEAT_FLOW, Variable.NOZZLE_FLOW):
        ranges[variable] = -flow / MM3_PER_MS, flow / MM3_PER_MS
    return {
        variable: (float(f"{low:.{_DIGITS}g}"), float(f"{high:.{_DIGITS}g}"))
        for variable, (low, high) in ranges.items()
        if low < high
    }


def _widened(values: Sequence[NDArray[np.float64]]) -> tuple[float, float]:
    """Ends of all values, with the margin."""
    low, high = (float(end(list(map(end, values)))) for end in (np.nanmin, np.nanmax))
    margin = MARGIN * (high - low)
    return low - margin, high + margin
