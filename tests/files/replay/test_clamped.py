"""Values of a recording that the signals of a bus cannot hold."""

import numpy as np

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.engine.signal_survey import Survey
from observer_rt.files.replay.framing import clamped_in


def warnings_of(**changed: float) -> list[str]:
    """Warnings about signals that leave the range of the bus in one value each."""
    survey = Survey()
    for name, inside in (("rail_pressure", 100e6), ("needle_lift", 100e-6), ("line_pressure", 100e6)):
        survey.take(name, np.array([inside, changed.get(name, inside), np.nan]))
    return clamped_in(survey, map_bus(load_bench()))


def test_values_out_of_range_are_told_by_role() -> None:
    assert warnings_of(needle_lift=605.334e-6) == []  # rounds to the largest value
    (lift,) = warnings_of(needle_lift=605.336e-6)
    assert lift.startswith("needle_lift: reaches 0.605336 mm, beyond 0.60533 mm")
    (above,) = warnings_of(line_pressure=400e6)
    assert above.startswith("line_pressure: reaches 400 MPa, beyond 317.665 MPa, the limit of ")
    (below,) = warnings_of(line_pressure=-10.1e6)
    assert below.startswith("line_pressure: reaches -10.1 MPa, beyond -10 MPa")
