"""An injection that what was learned does not reach, or not tell: its line says by how much, and what would help."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from observer_rt.core.stream.stream import RAIL_BIN
from observer_rt.daemon.log import injection_line
from observer_rt.engine.learning.mass import NEAR, VolumeBudget
from observer_rt.engine.reports.news import MeasuredMass
from observer_rt.engine.stream.state import Reason
from tests.daemon.samples import PRESSURE_SCALE, some_report
from tests.engine.plant_runs import worn_bench
from tests.observed_plants import observed
from tests.plants.laws import NO_LAWS, Laws


@pytest.mark.parametrize(
    ("rails", "said"),
    [
        ((43e6, 98e6), "what was learned reaches from 43 up to 98 MPa; record injections at 120 MPa"),
        ((-math.inf, 98e6), "what was learned reaches up to 98 MPa; record"),
        ((140e6, math.inf), "what was learned reaches from 140 MPa; record"),
        ((math.inf, -math.inf), "nothing learned reaches it; record injections at 120 MPa"),
        ((-math.inf, math.inf), "known to 6.4 %, but valid from 2 % on: 5.0 % are left open by events"),
    ],
)
def test_how_far_it_is(rails: tuple[float, float], said: str) -> None:
    budget = VolumeBudget(parameters=50e-9 * 0.05 / 1.96, inputs=1e-9, model=0.0, calibration=1e-9, parting=0.0)
    reach: dict[str, Any] = {"rail_pressure": 120e6, "known_rails": rails, "budget": budget}
    report = some_report(**reach, valid=False, reason=Reason.OUTSIDE_LEARNED_RANGE)
    assert said in injection_line(report)
    assert said not in injection_line(some_report(**reach))


@pytest.mark.parametrize(
    ("share", "sigma", "version", "text"),
    [
        (0.124, 0.005, 3, "flow 12 % above what was learned"),
        (-0.21, 0.005, 0, "flow 21 % below the model"),
        (0.03, 0.0099, 3, "flow 3 % above what was learned"),
        (0.03, 0.0101, 3, ""),  # of which the mass is not certain
        (0.009, 0.001, 3, ""),  # certain, and nobody need know
        (math.nan, 0.001, 3, ""),
    ],
)
def test_how_far_its_flow_is_from_what_was_learned(share: float, sigma: float, version: int, text: str) -> None:
    mass, level = 41.5e-6, 50e-9  # which all injections share, and the remainder does not
    budget = VolumeBudget(0.6 * sigma * 50e-9, 0.8 * sigma * 50e-9, 0.0, level, 0.0)
    report = some_report(mass=mass, predicted_mass=mass / (1.0 + share), phi_version=version, budget=budget)
    assert report.remainder == pytest.approx(share, nan_ok=True)
    assert report.remainder_text == text
    assert f" valid{text and f', {text}'}, command" in injection_line(report)
    assert some_report(predicted_mass=20e-6, budget=None).remainder_text == ""


def test_a_measured_mass_stands_beside_the_estimate() -> None:
    assert MeasuredMass(some_report(mass=42e-6), 40e-6).as_text().endswith("40.00 mg, estimate 42.00 mg (+5.00 %)")
    assert MeasuredMass(some_report(mass=math.nan), 40e-6).as_text().endswith("estimate unknown")


@pytest.mark.parametrize(("laws", "is_said"), [(Laws(rail_and_time=0.1), True), (NO_LAWS, False)])
def test_a_law_that_no_event_teaches_is_one_for_discover(laws: Laws, is_said: bool) -> None:
    bench = worn_bench(18, 5, durations=(0.6e-3,) * 3 + (1.9e-3,) * 3)
    said = ["run discover" in each.remainder_text for each in observed(replace(bench, laws=laws)).reports]
    assert (any(said[:6]), any(said[6:])) == (False, is_said)


def test_it_is_known_on_both_sides_of_the_rail_pressure_learned_at() -> None:
    report = observed(worn_bench(4, 3, rails=(50e6,))).reports[-1]
    assert abs(report.remainder) < 0.02
    below, above = 50e6 - np.array(report.known_rails)
    assert -(NEAR + RAIL_BIN) * PRESSURE_SCALE < above < 0.0 < below < (NEAR + RAIL_BIN) * PRESSURE_SCALE
