"""Combinations of effects as parameter vectors."""

import numpy as np
import pytest

from observer_rt.identification.discovery.search.hypothesis import Hypothesis
from observer_rt.identification.discovery.search.search import indistinguishable, representatives
from observer_rt.model.effects import VOCABULARY, effective_model, sized
from tests.identification.discovery.hidden import NOMINAL

BOTH = Hypothesis((VOCABULARY["lift_dependent_seat_coefficient"], VOCABULARY["line_friction"]))


def test_the_parameters_follow_effect_by_effect() -> None:
    theta = np.array([0.3, 50e-6, 0.5])
    assert [list(part) for part in BOTH.split(theta)] == [[0.3, 50e-6], [0.5]]
    expected = effective_model(
        NOMINAL, (sized("lift_dependent_seat_coefficient", a=0.3, x_c=50e-6), sized("line_friction", k=0.5))
    )
    assert BOTH.model(effective_model(NOMINAL), theta) == expected


def test_no_effect_is_the_nominal_model() -> None:
    nominal = effective_model(NOMINAL)
    assert Hypothesis().model(nominal, np.zeros(0)) == nominal
    assert [start.size for start in Hypothesis().starts()] == [0]


def test_starts_of_the_last_effect_with_the_others_off() -> None:
    friction = VOCABULARY["line_friction"].parameters[0]
    starts = BOTH.starts()
    assert [start[2] for start in starts] == list(friction.starts)
    assert all(start[0] == 0.0 for start in starts)


@pytest.mark.parametrize(
    ("friction", "plausible"),
    [(0.1, True), (1e-6, False), (10.0, False)],
    ids=["inside", "too small", "at a bound"],
)
def test_a_size_that_matters_and_no_bound_holds_back_is_plausible(friction: float, plausible: bool) -> None:
    assert BOTH.is_plausible(np.array([0.3, 200e-6, friction])) == plausible


def test_every_class_has_one_representative() -> None:
    chosen = {effect.id for effect in representatives()}
    for effect in VOCABULARY.values():
        assert len(chosen & {effect.id, *indistinguishable(effect)}) == 1
