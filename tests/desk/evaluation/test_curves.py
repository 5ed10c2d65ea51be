"""Which injections are drawn."""

import pytest

from observer_rt.desk.evaluation.curves import numbers_shown
from observer_rt.foundation.errors import UserError


def test_without_a_choice_first_middle_and_last() -> None:
    assert (numbers_shown((), range(1, 13)), numbers_shown((), {3})) == ([1, 7, 12], [3])
    assert (numbers_shown((), ()), numbers_shown((2, 5), range(1, 13))) == ([], [2, 5])


@pytest.mark.parametrize(("present", "choices"), [((), "no injection was found"), ((1, 2), "there are 1 to 2")])
def test_one_that_is_not_there_is_named(present: tuple[int, ...], choices: str) -> None:
    with pytest.raises(UserError, match=f"no injection 3(?s:.*){choices}"):
        numbers_shown((3,), present)
