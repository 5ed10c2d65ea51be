"""Recordings as a fit sees them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.evidence.measurement import measurements
from observer_rt.fit.parts import Weighed, centred_mean, parts_of, standstill_offset, thinned
from observer_rt.simulation.measurement import NoiseLevels
from observer_rt.simulation.schedule import make_schedule
from observer_rt.simulation.simulate import simulate
from tests.fit.healthy import NOMINAL, simulations

TWO = measurements([one.recording for one in simulations([(60e6, 0.6e-3), (100e6, 1.9e-3)], injections=5)])


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=60), st.integers(0, 20))
def test_a_centred_mean_is_that_of_the_samples_beside(values: list[float], width: int) -> None:
    given_values = np.array(values)
    result = centred_mean(given_values, width)
    half = (width - 1) // 2
    for k in range(given_values.size):
        if half >= 1 and half <= k < given_values.size - half:
            assert result[k] == pytest.approx(np.mean(given_values[k - half : k + half + 1]), abs=1e-9)
        else:
            assert result[k] == given_values[k]


def test_the_rail_is_quiet_and_nothing_else_changes() -> None:
    part = parts_of(TWO, {})[0]
    before, after = TWO[0].recording, part.measurement.recording
    assert np.std(after.rail_pressure) < 0.5 * np.std(before.rail_pressure)
    assert np.array_equal(after.line_pressure, before.line_pressure)
    assert part.measurement.noise == TWO[0].noise


def test_a_recording_of_two_operating_points_falls_into_them() -> None:
    schedule = make_schedule([60e6, 100e6], 4, 0.06, [0.6e-3])
    mixed = simulate(NOMINAL, schedule, 100e3, (), NoiseLevels()).recording
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
