"""The table of what an event may be."""

import numpy as np
import pytest

from observer_rt.engine.estimation.gating import prior_belief
from observer_rt.engine.estimation.scalars import SCALARS
from observer_rt.engine.learning.hypotheses import (
    AT_FAULT,
    BEFORE,
    INADEQUATE,
    LIFT_LATE,
    NEEDLE_CHANGED,
    NEW,
    NEW_AT_FIRST,
    QUICK,
    Kind,
    Mode,
    is_alike,
    transitions,
)

SCALE = 1e8  # Pa
WIDE, DRIFT = SCALARS.prior(SCALE), SCALARS.drift(SCALE)
HYPOTHESES = (BEFORE, QUICK, *NEW, AT_FAULT, INADEQUATE)
MOVING = [kind for kind in HYPOTHESES if kind.columns]


@pytest.mark.parametrize("has_lift", [False, True])
@pytest.mark.parametrize("is_prior", [False, True])
@pytest.mark.parametrize("mode", Mode)
def test_one_of_them_an_event_is(mode: Mode, is_prior: bool, has_lift: bool) -> None:
    result = dict(transitions(mode, is_prior, has_lift))
    assert sum(result.values()) == pytest.approx(1.0)
    assert min(result.values()) > 0.0
    assert BEFORE in result
    other = {NEEDLE_CHANGED if has_lift else LIFT_LATE}
    assert {kind for kind in NEW if kind in result} == set(NEW_AT_FIRST if is_prior else NEW) - other


@pytest.mark.parametrize("kind", MOVING, ids=[kind.name for kind in MOVING])
def test_it_moves_its_columns_and_no_other(kind: Kind) -> None:
    widths = kind.widths(WIDE, DRIFT)
    assert np.all((widths > 0.0) == np.isin(np.arange(SCALARS.width), kind.columns))
    assert kind is LIFT_LATE or np.all(widths <= WIDE)


def test_every_column_may_change_by_a_kind_of_its_own_name() -> None:
    assert len({kind.name for kind in HYPOTHESES}) == len(HYPOTHESES)
    assert {column for kind in NEW for column in kind.columns} == set(range(SCALARS.width))


def test_a_surer_belief_is_not_alike() -> None:
    older = prior_belief(np.zeros(SCALARS.width), np.diag((0.2 * WIDE) ** 2))
    surer = prior_belief(np.minimum(1e-5, 0.1 * WIDE), np.diag((0.01 * WIDE) ** 2))
    assert not is_alike(older, surer)
    assert is_alike(surer, surer)
