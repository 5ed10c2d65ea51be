"""Fits to maps of masses of injectors that the fit cannot see: what masses tell, and what they do not."""

from dataclasses import replace

import numpy as np
import pytest

from observer_rt.config.bench import NOMINAL_INJECTOR, load_injector
from observer_rt.desk.injection_map.map_fit import BACK_PRESSURE, MapFit, fit_map
from observer_rt.desk.injection_map.mass_map import MassMap
from observer_rt.desk.injection_map.simulated_masses import masses_of
from observer_rt.foundation.units import Floats
from observer_rt.model.parameters import InjectorParameters

NOMINAL = load_injector(NOMINAL_INJECTOR)
PRESSURES, DURATIONS = np.meshgrid([40e6, 80e6, 120e6, 160e6], [0.25e-3, 0.3e-3, 0.4e-3, 0.6e-3, 1e-3, 1.8e-3])
OTHER_PRESSURES, OTHER_DURATIONS = np.array([60e6, 100e6, 140e6]), np.array([0.8e-3, 0.5e-3, 1.4e-3])
NOISE = 0.01  # of a mass


def changed(**sections: dict[str, float]) -> InjectorParameters:
    parts = {name: getattr(NOMINAL, name).model_copy(update=keys) for name, keys in sections.items()}
    return NOMINAL.model_copy(update=parts)


HIDDEN = changed(
    nozzle={"flow_coefficient": 0.66},
    chamber={"pressure": 3e6},
    needle={
        "opening_delay": 0.4e-3,
        "opening_speed": 1.0,
        "closing_delay": 0.25e-3,
        "closing_speed": 0.75,
        "delay_exponent": 0.3,
    },
)


def masses_at(of: MassMap, injector: InjectorParameters) -> Floats:
    return masses_of(injector, of.rail_pressure, of.energizing)


def measured(injector: InjectorParameters, pressures: Floats, durations: Floats) -> MassMap:
    shape = MassMap(pressures.ravel(), durations.ravel(), *np.zeros((2, pressures.size)))
    masses = masses_at(shape, injector) * np.random.default_rng(7).normal(1.0, NOISE, pressures.size)
    return replace(shape, mass=masses, sigma=np.hypot(NOISE * masses, 0.02e-6))


def fitted(of: MassMap) -> MapFit:
    shares: list[float] = []
    done = fit_map(NOMINAL, of, shares.append)
    assert shares == sorted(shares)
    assert 0.0 <= shares[0] < shares[-1] <= 1.0
    return done


@pytest.fixture(scope="module")
def of_hidden() -> MapFit:
    return fitted(measured(HIDDEN, PRESSURES, DURATIONS))


@pytest.mark.parametrize(
    ("name", "true", "width"),
    [
        ("nozzle.flow_coefficient", 0.66, 0.08),
        ("chamber.pressure", 3.0, 8.0),
        ("needle.opening_speed", 1.0, 0.3),
        ("needle.closing_speed", 0.75, 0.2),
        ("needle.delay_exponent", 0.3, 0.1),
    ],
)
def test_numbers_are_inside_their_intervals(of_hidden: MapFit, name: str, true: float, width: float) -> None:
    low, high = of_hidden.sizes[name].ci95
    assert low < true < high
    assert high - low < width


def test_of_the_delays_masses_tell_the_difference_best(of_hidden: MapFit) -> None:
    low, high = of_hidden.delay_difference.ci95
    assert low < -150.0 < high
    assert high - low < 40.0  # us
    low, high = of_hidden.sizes["needle.opening_delay"].ci95
    assert low < 400.0 < high
    assert high - low > 50.0


def test_masses_between_the_points_are_those_of_the_hidden_injector(of_hidden: MapFit) -> None:
    between = measured(HIDDEN, OTHER_PRESSURES, OTHER_DURATIONS)
    true = masses_at(between, HIDDEN)
    assert np.abs(masses_at(between, NOMINAL) / true - 1.0).max() > 0.1
    np.testing.assert_allclose(masses_at(between, of_hidden.injector), true, rtol=0.015)


def test_a_point_that_is_wrong_is_named_by_its_distance_and_misleads_little() -> None:
    true = measured(HIDDEN, PRESSURES, DURATIONS)
    wrong = true.mass.copy()
    wrong[8] *= 1.5
    done = fitted(replace(true, mass=wrong))
    assert np.argmax(np.abs(done.off)) == 8
    off = np.abs(masses_at(true, done.injector) - masses_at(true, HIDDEN)) / np.maximum(true.mass, 1e-6)
    assert np.median(off) < 0.01
    assert off.max() < 0.1


def test_one_rail_pressure_says_nothing_of_laws_of_the_pressure() -> None:
    done = fitted(measured(HIDDEN, PRESSURES[:, 1], DURATIONS[:, 1]))
    assert {"chamber.pressure", "needle.delay_exponent"}.isdisjoint(done.sizes)
    np.testing.assert_allclose(done.masses, done.map.mass, rtol=0.05)


def test_a_stated_back_pressure_is_taken_over_and_not_fitted() -> None:
    done = fitted(replace(measured(HIDDEN, PRESSURES, DURATIONS), back_pressure=3e6))
    assert done.injector.chamber.pressure == 3e6
    assert BACK_PRESSURE.name not in done.sizes
    assert BACK_PRESSURE in done.written
    assert done.injector.nozzle.flow_coefficient == pytest.approx(0.66, rel=0.02)
