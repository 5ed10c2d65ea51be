"""Injections beside a test plan: which point they belong to, their mass there, and what its tolerance says."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from observer_rt.config.bench import load_injector
from observer_rt.desk.injection_map.beside_map import beside_map
from observer_rt.desk.injection_map.mass_map import MassMap
from observer_rt.desk.injection_map.simulated_masses import masses_of
from observer_rt.foundation.units import Z_95, Floats

NOMINAL = load_injector()
PLAN = MassMap(
    np.array([60e6, 100e6, 100e6]),
    np.array([0.6e-3, 0.6e-3, 1.2e-3]),
    np.array([25e-6, 37e-6, 70e-6]),
    np.array([1e-6, 1e-6, 2e-6]),
)


def nominal(pressure: float, duration: float) -> float:
    return float(masses_of(NOMINAL, np.array([pressure]), np.array([duration]))[0])


def shot(pressure: float, duration: float, mass: float, bound: float = 0.1e-6, valid: bool = True) -> Any:
    """A report, as far as a comparison reads it."""
    command = SimpleNamespace(energizing_time=duration)
    return SimpleNamespace(rail_pressure=pressure, commanded=command, mass=mass, mass_bound=bound, valid=valid)


def test_a_mass_is_carried_to_its_point_by_the_model() -> None:
    at, near = nominal(100e6, 0.6e-3), nominal(103e6, 0.61e-3)
    (_, point, _) = beside_map(PLAN, [shot(103e6, 0.61e-3, 1.1 * near)], NOMINAL)
    assert point.mass_mg == pytest.approx(1.1e6 * at)
    assert (point.rail_pressure_MPa, point.injections) == (100.0, 1)
    assert point.tolerance_mg == pytest.approx(Z_95)


@pytest.mark.parametrize(
    ("beyond", "bound", "verdict"),
    [(-0.5, 0.1, "inside"), (0.5, 0.1, "outside"), (0.1, 0.3, "open"), (-2.5, 0.1, "inside")],
)
def test_a_verdict_knows_its_own_interval(beyond: float, bound: float, verdict: str) -> None:
    mass = PLAN.mass[0] + (Z_95 + beyond) * 1e-6
    (point, *_) = beside_map(PLAN, [shot(60e6, 0.6e-3, mass, bound * 1e-6)], NOMINAL)
    assert point.verdict == verdict


def test_what_is_far_or_not_valid_or_without_a_command_is_at_no_point() -> None:
    others = [
        shot(80e6, 0.6e-3, 30e-6),
        shot(60e6, 0.9e-3, 30e-6),
        shot(60e6, 0.6e-3, 30e-6, valid=False),
        SimpleNamespace(rail_pressure=60e6, commanded=None, mass=30e-6, mass_bound=1e-7, valid=True),
    ]
    points = beside_map(PLAN, others, NOMINAL)
    assert [(point.injections, point.mass_mg, point.verdict) for point in points] == [(0, None, None)] * 3


def test_several_injections_of_a_point_are_its_mean() -> None:
    masses: Floats = np.array([24e-6, 26e-6, 25.5e-6])
    (point, *_) = beside_map(PLAN, [shot(60e6, 0.6e-3, mass) for mass in masses], NOMINAL)
    assert point.injections == 3
    assert point.mass_mg == pytest.approx(1e6 * masses.mean())
