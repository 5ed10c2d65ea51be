"""Units of the learned scalars."""

from observer_rt.engine.estimation.parameters import ScalarUnit
from observer_rt.model.effective import LAG_UNIT, LIFT_UNIT


def test_a_theta_of_one_is_its_unit() -> None:
    """A share is as it is; a pressure counts in p_0, a time and a lift in units of their own."""
    units = ScalarUnit.AS_IT_IS, ScalarUnit.PRESSURE, ScalarUnit.TIME, ScalarUnit.LENGTH
    assert [unit.unit(2e8) for unit in units] == [1.0, 2e8, LAG_UNIT, LIFT_UNIT]
