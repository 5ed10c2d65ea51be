"""Numbers as people read them."""

import pytest

from observer_rt.foundation.units import shown


@pytest.mark.parametrize(("step", "text"), [(0.0, "123457"), (0.01, "123456.79"), (100.0, "123500"), (1e5, "1e+05")])
def test_a_value_is_rounded_to_its_step(step: float, text: str) -> None:
    assert shown(123456.789, step) == text
