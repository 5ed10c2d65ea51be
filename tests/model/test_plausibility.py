"""Numbers that no injector has, and the entries of the file that they point to."""

import numpy as np
import pytest

from observer_rt.config.bench import load_injector
from observer_rt.identification.fit.forms import NOZZLE, SEAT, STIFFNESS, FreeParameter, with_values
from observer_rt.model.plausibility import implausible


def test_the_nominal_injector_has_what_injectors_have() -> None:
    """Also with petrol."""
    nominal = load_injector()
    assert implausible(nominal) == implausible(with_values(nominal, [STIFFNESS], np.array([0.78e9]))) == ()


@pytest.mark.parametrize(
    ("changed", "factor", "entry"),
    [
        (STIFFNESS, 3.0, "line.volume"),
        (STIFFNESS, 0.4, "line.length"),
        (NOZZLE, 0.5, "nozzle.hole_diameter"),
        (SEAT, 0.35, "seat.diameter"),
    ],
)
def test_a_number_that_no_injector_has_is_named_with_what_it_makes_up_for(
    changed: FreeParameter, factor: float, entry: str
) -> None:
    nominal = load_injector()
    (odd,) = implausible(with_values(nominal, [changed], np.array([factor * changed.of(nominal)])))
    assert odd.name == changed.name
    assert changed.name in odd.words
    assert entry in odd.made_up_for
