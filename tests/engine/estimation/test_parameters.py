"""Units of the learned scalars."""

from observer_rt.engine.estimation.parameters import ScalarUnit
from observer_rt.model.effective import LAG_UNIT, LIFT_UNIT


def test_a_theta_of_one_is_its_unit() -> None:
    """A share is as it is; a pressure counts in p_0, a time and a lift in units of their own."""
    sizes = {unit: unit.unit(2e8) for unit in ScalarUnit}
    assert sizes == {
        ScalarUnit.AS_IT_IS: 1.0,
        ScalarUnit.PRESSURE: 2e8,
        ScalarUnit.TIME: LAG_UNIT,
        ScalarUnit.LENGTH: LIFT_UNIT,
    }
