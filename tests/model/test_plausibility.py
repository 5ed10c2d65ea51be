"""Numbers that no injector has, and the entry of the file that they point to."""

import numpy as np
import pytest

from observer_rt.config.bench import load_injector
from observer_rt.identification.fit.problem import NOZZLE, SAC, SEAT, STIFFNESS, FreeParameter, with_values
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.plausibility import implausible, wrong_entry


def _with(*changes: tuple[FreeParameter, float]) -> InjectorParameters:
    """The nominal injector, some of its numbers times a factor."""
    nominal = load_injector()
    free = [one for one, _ in changes]
    return with_values(nominal, free, np.array([factor * one.of(nominal) for one, factor in changes]))


def test_the_nominal_injector_has_what_injectors_have() -> None:
    assert implausible(load_injector()) == ()
    assert wrong_entry(load_injector(), ()) == ""


@pytest.mark.parametrize(
    ("changes", "name", "entry"),
    [
        (((STIFFNESS, 3.0), (SEAT, 1 / 3), (NOZZLE, 1 / 3), (SAC, 1 / 3)), "bulk_modulus_line", "too long"),
        (((STIFFNESS, 0.5), (SEAT, 2.0), (NOZZLE, 2.0), (SAC, 2.0)), "bulk_modulus_line", "too short"),
        (((STIFFNESS, 3.0),), "bulk_modulus_line", "line.volume is probably too large"),
        (((STIFFNESS, 0.4),), "bulk_modulus_line", "line.volume is probably too small"),
        (((NOZZLE, 0.5),), "nozzle.flow_coefficient", "area of the holes is probably too large"),
        (((NOZZLE, 1.5),), "nozzle.flow_coefficient", "area of the holes is probably too small"),
        (((SEAT, 0.35),), "seat.flow_coefficient", "seat's area is probably too large"),
    ],
)
def test_what_a_fit_made_up_for_is_named(
    changes: tuple[tuple[FreeParameter, float], ...], name: str, entry: str
) -> None:
    """A line three times too long scales 1/K_L, coefficients and sac by a third: the pressures are the same."""
    injector = _with(*changes)
    odd = implausible(injector)
    assert any(name in one.name for one in odd)
    assert all(one.name in one.words for one in odd)
    assert entry in wrong_entry(injector, odd)
