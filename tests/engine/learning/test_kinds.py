"""The table of what an event may be."""

import numpy as np
import pytest

from observer_rt.engine.estimation.parameters import SCALARS
from observer_rt.engine.learning import kinds

SCALE = 1e8  # Pa
WIDE, DRIFT = SCALARS.prior(SCALE), SCALARS.drift(SCALE)
HYPOTHESES = (kinds.BEFORE, kinds.QUICK, *kinds.NEW, kinds.AT_FAULT, kinds.INADEQUATE)
MOVING = [kind for kind in HYPOTHESES if kind.columns]


@pytest.mark.parametrize("has_lift", [False, True])
@pytest.mark.parametrize("is_prior", [False, True])
@pytest.mark.parametrize("mode", kinds.Mode)
def test_one_of_them_an_event_is(mode: kinds.Mode, is_prior: bool, has_lift: bool) -> None:
    result = dict(kinds.transitions(mode, is_prior, has_lift))
    assert sum(result.values()) == pytest.approx(1.0)
    assert min(result.values()) > 0.0
    assert kinds.BEFORE in result
    other = {kinds.NEEDLE_CHANGED if has_lift else kinds.LIFT_LATE}
    new = kinds.NEW_AT_FIRST if is_prior else kinds.NEW
    assert {kind for kind in kinds.NEW if kind in result} == set(new) - other


@pytest.mark.parametrize("kind", MOVING, ids=[kind.name for kind in MOVING])
def test_it_moves_its_columns_and_no_other(kind: kinds.Kind) -> None:
    widths = kind.widths(WIDE, DRIFT)
    assert np.all((widths > 0.0) == np.isin(np.arange(SCALARS.width), kind.columns))
    assert kind is kinds.LIFT_LATE or np.all(widths <= WIDE)


def test_every_column_may_change_by_a_kind_of_its_own_name() -> None:
    assert len({kind.name for kind in HYPOTHESES}) == len(HYPOTHESES)
    assert {column for kind in kinds.NEW for column in kind.columns} == set(range(SCALARS.width))


def test_a_kind_that_moves_only_what_is_held_is_refused() -> None:
    with pytest.raises(ValueError, match="gain changed: events tell of none of its columns"):
        kinds.Kind("gain changed", kinds.Mode.STEADY, 0.01, SCALARS.gate.held)
