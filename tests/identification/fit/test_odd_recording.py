"""A recording of a worn injector among healthy ones is named, and no healthy one ever."""

import pytest

from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, Simulation, simulate
from observer_rt.identification.fit.calibrate import Calibrated, calibrate
from observer_rt.identification.fit.report import verdict_words
from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.model.effects import sized
from tests.identification.fit.healthy import (
    NOMINAL,
    POINTS,
    of_independent_plant,
    off_by_ten_percent,
    simulations,
)
from tests.identification.fit.test_calibrate import LUMPS
from tests.plants.parameters import Injector


def _worn(number: int, effect: str, **sizes: float) -> Simulation:
    """In place of one of the healthy ones."""
    pressure, duration = POINTS[number]
    schedule = make_schedule([pressure], 3, 0.05, [duration])
    return simulate(
        NOMINAL, schedule, 100e3, (sized(effect, **sizes),), SimulatedNoise(), False, seed=100 + number
    )


def _fit(made: list[Simulation]) -> Calibrated:
    found = measurements([one.recording for one in made])
    return calibrate(off_by_ten_percent(), found, {}, lambda _: None, LUMPS)


@pytest.mark.parametrize(
    ("number", "effect", "size"), [(2, "orifice_area", {"v_H": 0.2}), (5, "seat_area", {"v_S": -0.2})]
)
def test_the_recording_of_a_worn_injector_is_named(number: int, effect: str, size: dict[str, float]) -> None:
    made = simulations()
    made[number] = _worn(number, effect, **size)
    done = _fit(made)
    assert done.odd is not None
    assert done.odd.recording == number
    assert done.odd.chi2[1] < 2.0 < 5.0 < done.odd.chi2[0]
    assert f"leave out {number}" in verdict_words(done)


def test_of_two_halves_none_is_odd() -> None:
    """Three healthy and three worn recordings: each says as much against the others."""
    made = simulations()
    for number in (0, 2, 4):
        made[number] = _worn(number, "orifice_area", v_H=0.2)
    done = _fit(made)
    assert done.inadequate
    assert done.odd is None


def test_a_line_that_the_model_does_not_describe_accuses_no_recording() -> None:
    recordings = of_independent_plant(Injector(line_cells=24, line_damping=0.15))
    done = calibrate(NOMINAL, measurements(recordings), {}, lambda _: None, LUMPS)
    assert done.inadequate
    assert done.odd is None
