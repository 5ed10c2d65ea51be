"""Combinations of effects as parameter vectors."""

import numpy as np
import pytest

from observer_rt.identification.discovery.search.hypothesis import Hypothesis
from observer_rt.identification.discovery.search.search import indistinguishable, representatives
from observer_rt.model.effects import VOCABULARY

BOTH = Hypothesis((VOCABULARY["lift_dependent_seat_coefficient"], VOCABULARY["line_friction"]))


@pytest.mark.parametrize(("friction", "plausible"), [(0.1, True), (1e-6, False), (10.0, False)])
def test_a_size_that_matters_and_no_bound_holds_back_is_plausible(friction: float, plausible: bool) -> None:
    assert BOTH.is_plausible(np.array([0.3, 200e-6, friction])) == plausible


def test_every_class_has_one_representative() -> None:
    chosen = {effect.id for effect in representatives()}
    for effect in VOCABULARY.values():
        assert len(chosen & {effect.id, *indistinguishable(effect)}) == 1
