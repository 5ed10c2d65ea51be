"""Events that scatter by more than the belief says."""

import pytest

from observer_rt.engine.learning.account import Scatter


def test_events_that_scatter_widen_what_is_believed() -> None:
    usual, odd = Scatter(), Scatter()
    for _ in range(20):
        usual, odd = usual.after(0.9), odd.after(3.0)
    assert usual.factor == 1.0
    assert odd.factor == pytest.approx(3.0, rel=0.25)
