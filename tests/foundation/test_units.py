"""Numbers as people read them."""

import pytest

from observer_rt.foundation.units import first_of, shown


@pytest.mark.parametrize(("step", "text"), [(0.0, "123457"), (0.01, "123456.79"), (100.0, "123500"), (1e5, "1e+05")])
def test_a_value_is_rounded_to_its_step(step: float, text: str) -> None:
    assert shown(123456.789, step) == text


@pytest.mark.parametrize(("most", "text"), [(1, "a and 2 more"), (2, "a, b and 1 more"), (3, "a, b, c")])
def test_of_many_words_the_first_are_said(most: int, text: str) -> None:
    assert first_of(["a", "b", "c"], most) == text
