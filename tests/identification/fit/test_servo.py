"""A healthy servo injector: its control flow is part of the fit, also beside masses; without any nothing is said."""

from functools import cache

import numpy as np
import pytest

from observer_rt.identification.fit.calibrate import CalibrationResult, calibrate
from observer_rt.identification.fit.forms import (
    CONTROL,
    DISPLACEMENT,
    INERTANCE,
    OPTIONAL_GROUPS,
    STIFFENING,
    STIFFNESS,
    with_values,
)
from observer_rt.identification.fit.masses import MEAN, WeighedMass
from observer_rt.identification.likelihood.measurement import measurements
from tests.identification.fit.healthy import HEALTHY, LUMPS, POINTS, of_independent_plant, off_by_ten_percent
from tests.observed_plants import recording_of
from tests.plants.laws import Laws
from tests.plants.parameters import Injector
from tests.plants.plant import Bench, Event, Needle, Shot, record
from tests.plants.windows import true_masses

MM3_PER_MS, MICROSECOND = 1e-6, 1e-6
NEW = Injector()
CHAMBER = Laws(control_flow=13e-6, chamber_inlet=10e-6, guide_area=7e-6)


@cache
def fitted(laws: Laws, points: tuple[tuple[float, float], ...] = POINTS[:2] + POINTS[4:]) -> CalibrationResult:
    """To a recording a point of an independent plant, from numbers 10 % off and no control flow."""
    measured_recordings = measurements(of_independent_plant(Injector(), points, laws=laws))
    return calibrate(off_by_ten_percent(), measured_recordings, {}, lambda _: None, LUMPS[:1])


@pytest.mark.parametrize("flow", [1.5, pytest.param(8.0, marks=pytest.mark.slow)])
def test_its_control_flow_is_found(flow: float) -> None:
    laws = Laws(control_flow=flow * MM3_PER_MS)
    done = fitted(laws, POINTS)
    assert done.inadequate == ()
    size = done.sizes["line.control_flow"]
    assert size.value == pytest.approx(flow, abs=0.15)
    assert size.ci95[1] - size.ci95[0] < 0.4
    lift_off = 15e-6 / Needle().opening_speed  # s, after the needle has left its seat
    expected = (laws.control_lead + lift_off) / MICROSECOND
    assert done.sizes["line.control_start"].value == pytest.approx(expected, abs=12.0)
    assert done.injector.nozzle.flow_coefficient == pytest.approx(0.78, rel=3e-3)
    assert "line.displacement" not in done.sizes


@pytest.mark.parametrize("moves", [50.0, 250.0])
def test_a_needle_that_rises_into_its_chamber_does_not_change_the_level(moves: float) -> None:
    """What it displaces there leaves by the valve, quick or gradual, and does not come back as it falls."""
    done = fitted(Laws(control_flow=13e-6, chamber_inlet=10e-6, guide_area=7e-6, control_moves=1e-6 * moves), POINTS)
    assert done.inadequate == ()
    assert done.injector.nozzle.flow_coefficient == pytest.approx(0.78, rel=3e-3)  # 1.6 % more without it
    assert done.sizes["line.control_displacement"].ci95[0] > 2.0
    assert done.sizes["line.control_edge"].value == pytest.approx(0.4 * moves, rel=0.3)


def test_of_an_injector_without_any_nothing_is_said() -> None:
    done = fitted(Laws())
    assert done.inadequate == ()
    assert not done.sizes.keys() & {one.name for group in OPTIONAL_GROUPS for one in group}
    assert all(one.stated(done.injector) is None for one in (CONTROL[0], DISPLACEMENT))


def test_a_needle_that_displaces_fuel_has_no_control_flow() -> None:
    done = fitted(Laws(needle_area=1e-6))
    assert done.inadequate == ()
    assert done.sizes["line.displacement"].value == pytest.approx(1.0, abs=0.2)
    assert "line.control_flow" not in done.sizes


def weighed(laws: Laws, single: bool, part: Injector = NEW) -> tuple[CalibrationResult, float]:
    """From a bore 2.4 % off, with masses to 0.5 % of injections or their means; the short ones' error (rms)."""
    random, recordings, true, masses = np.random.default_rng(1), [], [], {}
    for number, pressure in enumerate((60e6, 100e6, 140e6)):
        events = tuple(Event(pressure, (Shot(0.0, duration),), HEALTHY) for duration in 3 * (0.9e-3, 2.2e-3))
        outcome = record(bench := Bench(part, Needle(), events, seed=100 + number, laws=laws))
        recordings.append(recording_of(outcome))
        true.append(true_masses(outcome, bench))
        seen = true[-1] * random.normal(1.0, 0.005, true[-1].size)
        mean = WeighedMass(float(seen.mean()), 0.005 * float(seen.mean()) / 6**0.5)
        of_each = {1 + place: WeighedMass(mass, 0.005 * mass) for place, mass in enumerate(seen.tolist())}
        masses[number] = of_each if single else {MEAN: mean}
    start = off_by_ten_percent()
    stiffness = part.bulk_modulus_line, part.stiffening
    start = with_values(start, [INERTANCE, STIFFNESS, STIFFENING], np.array([1.05 * INERTANCE.of(start), *stiffness]))
    done = calibrate(start, measurements(recordings), masses, lambda _: None, LUMPS[:1])
    off = [judged.masses / exact - 1.0 for judged, exact in zip(done.comparison.after.judged, true, strict=True)]
    return done, float(np.sqrt(np.mean(np.concatenate([one[::2] for one in off]) ** 2)))


def test_masses_of_injections_find_the_bore_beside_a_pilot_valve() -> None:
    done, error = weighed(CHAMBER, single=True)
    low, high = done.sizes["line.diameter"].ci95
    assert low < 2.4 < high < low + 0.008
    assert error < 0.002
    assert done.comparison.mass_misfit < 0.002


def test_masses_show_that_the_nozzle_s_coefficient_changes_with_pressure() -> None:
    """Of fuel that is as dense in the holes as midway, which is not the model's law."""
    fuel = Injector(bulk_modulus_line=1.25e9, bulk_modulus_sac=1.25e9, stiffening=10.8)
    done, error = weighed(Laws(), single=False, part=fuel)
    low, high = done.sizes["nozzle.coefficient_by_pressure"].ci95
    assert low < 2.8 < high < low + 1.0  # %: 50 MPa over K at 50 MPa
    assert error < 0.003
    assert done.mass_share < 0.003


@pytest.mark.slow
def test_masses_of_injections_show_a_law_that_means_over_durations_hide() -> None:
    """Of a nozzle that lets less through the longer it is open, which no model of a fit has."""
    laws = CHAMBER._replace(coking=0.05)
    (single, error), (by_means, error_by_means) = weighed(laws, single=True), weighed(laws, single=False)
    assert by_means.mass_share < 0.002 < 0.006 < error_by_means
    assert error < error_by_means
    assert single.mass_share == pytest.approx(error, abs=0.001)
