"""Recordings taken apart by operating point."""

import numpy as np
import pytest

from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.files.signals.recording import Recording
from observer_rt.identification.likelihood.excerpts import by_operating_point, distinct
from observer_rt.identification.likelihood.likelihood import joint_likelihood
from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effects import effective_model, sized
from tests.identification.discovery.hidden import MODEL, NOMINAL, recordings


def _history(measured_rate: bool = False) -> list[Recording]:
    schedule = make_schedule([60e6, 140e6, 100e6], 6, 0.06, [0.6e-3, 1.9e-3])
    return [simulate(NOMINAL, schedule, 100e3, (), SimulatedNoise(), measured_rate, seed=7).recording]


def test_every_pressure_and_duration_is_a_point() -> None:
    commanded = [one.with_arrays({"energizing": np.zeros(one.samples)}) for one in _history()]
    points = by_operating_point(measurements(commanded))
    assert [point.name.split(",")[0] for point in points] == [*["60 MPa"] * 2, *["100 MPa"] * 2, *["140 MPa"] * 2]
    durations = [point.measurement.duration for point in points]
    assert durations[0::2] == pytest.approx([0.9e-3] * 3, abs=0.1e-3)
    assert durations[1::2] == pytest.approx([2.2e-3] * 3, abs=0.1e-3)
    assert {point.file for point in points} == {0}


def test_recordings_of_one_point_stay_one() -> None:
    points = by_operating_point(measurements(recordings()))
    assert [point.file for point in points] == [0, 1]
    assert [len(point.measurement.events) for point in points] == [2, 2]
    assert distinct([65e6, 140e6, 60e6, 62e6]) == 3  # as well as they are controlled


@pytest.mark.parametrize("hidden", [(), (sized("lift_offset", x_0=15e-6),), (sized("channel_skew", d=23e-6),)])
def test_a_model_explains_the_points_as_well_as_the_whole(hidden: tuple[SizedEffect, ...]) -> None:
    complete = measurements(_history())
    parts = [point.measurement for point in by_operating_point(complete)]
    model = effective_model(NOMINAL, hidden)
    together, apart = (joint_likelihood(of, MODEL).judge(model) for of in (complete, parts))
    assert together is not None
    assert apart is not None
    result = np.sort(np.concatenate([one.z for one in apart]))
    np.testing.assert_allclose(result, np.sort(together[0].z), rtol=0, atol=1e-9)
