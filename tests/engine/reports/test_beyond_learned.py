"""An injection that what was learned does not reach: its line says how far it does, and what would help."""

import math
from typing import Any

import pytest

from observer_rt.daemon.log import line
from observer_rt.engine.learning.interval import VolumeBudget
from observer_rt.engine.stream.state import Reason
from tests.daemon.samples import some_report


@pytest.mark.parametrize(
    ("rails", "said"),
    [
        ((43e6, 98e6), "what was learned reaches from 43 up to 98 MPa; record injections at 120 MPa"),
        ((-math.inf, 98e6), "what was learned reaches up to 98 MPa; record"),
        ((140e6, math.inf), "what was learned reaches from 140 MPa; record"),
        ((math.inf, -math.inf), "nothing learned reaches it; record injections at 120 MPa"),
        ((-math.inf, math.inf), "its mass to 5.0 %, its duration or lift is not"),
    ],
)
def test_how_far_it_is(rails: tuple[float, float], said: str) -> None:
    budget = VolumeBudget(parameters=50e-9 * 0.05 / 1.96, inputs=1e-9, model=0.0, calibration=1e-9, parting=0.0)
    reach: dict[str, Any] = {"rail_pressure": 120e6, "known_rails": rails, "budget": budget}
    report = some_report(**reach, valid=False, reason=Reason.OUTSIDE_LEARNED_RANGE)
    assert said in line(report)
    assert said not in line(some_report(**reach))
