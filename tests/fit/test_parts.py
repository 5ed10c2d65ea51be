"""Recordings as a fit sees them."""

from dataclasses import replace

import numpy as np
import pytest

from observer_rt.evidence.measurement import measurements
from observer_rt.fit.parts import Weighed, parts_of, standstill_offset, thinned
from observer_rt.simulation.schedule import make_schedule
from observer_rt.simulation.simulate import SimulatedNoise, simulate
from tests.fit.healthy import NOMINAL, simulations

TWO = measurements([one.recording for one in simulations([(60e6, 0.6e-3), (100e6, 1.9e-3)], injections=5)])


def test_a_recording_of_two_operating_points_falls_into_them() -> None:
    schedule = make_schedule([60e6, 100e6], 4, 0.06, [0.6e-3])
    mixed = simulate(NOMINAL, schedule, 100e3, (), SimulatedNoise()).recording
    parts = parts_of(measurements([mixed]), {})
    assert [len(part.measurement.events) for part in parts] == [2, 2]
    assert {part.recording for part in parts} == {0}


def test_a_thinned_part_stands_for_all_its_injections() -> None:
    part = thinned(parts_of(TWO, {})[1], 2)
    assert len(part.measurement.events) == 2
    assert part.weights.tolist() == [2.5, 2.5]


def test_masses_are_compared_in_standard_deviations() -> None:
    first = TWO[0].events[1].openings[0].first
    part = parts_of(TWO, {0: Weighed({first: (2.0, 0.1)}, (3.0, 0.5))})[0]
    residuals = part.mass_residuals(np.array([1.0, 2.3, 3.0, 4.0, 5.0]))
    assert residuals == pytest.approx([3.0, (3.06 - 3.0) / 0.5])
    assert parts_of(TWO, {})[0].mass_residuals(np.ones(5)).size == 0


def test_an_offset_is_found_at_standstill() -> None:
    recording = TWO[0].recording
    (moved,) = measurements([replace(recording, line_pressure=recording.line_pressure + 0.8e6)])
    before, after = (standstill_offset(parts_of([one], {})[0]) for one in (TWO[0], moved))
    assert after - before == pytest.approx(0.8e6, abs=1.0)
