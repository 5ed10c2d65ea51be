"""Which injections are drawn."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.desk.evaluation.curves import MOST_CURVES, chosen_numbers, numbers_shown
from observer_rt.foundation.errors import UserError


@pytest.mark.parametrize(
    ("text", "numbers"), [("7", (7,)), ("1,5-8", (1, 5, 6, 7, 8)), (" 3 - 4 , 3", (3, 4)), ("2-2", (2,))]
)
def test_numbers_and_ranges(text: str, numbers: tuple[int, ...]) -> None:
    assert chosen_numbers(text) == numbers


@pytest.mark.parametrize("text", ["", "0", "-3", "1-", "a", "1;2", "1.5", "5-1", "1-9", "1-99999999", "1,,2"])
def test_what_is_no_choice_is_refused(text: str) -> None:
    with pytest.raises(UserError, match="--injections: "):
        chosen_numbers(text)


@given(st.text(alphabet="0123456789,- ²٣", max_size=12))
def test_any_text_is_a_choice_or_refused(text: str) -> None:
    try:
        numbers = chosen_numbers(text)
    except UserError:
        return
    assert 0 < len(numbers) <= MOST_CURVES
    assert list(numbers) == sorted(set(numbers))


def test_without_a_choice_first_middle_and_last() -> None:
    assert numbers_shown((), range(1, 13)) == [1, 7, 12]
    assert numbers_shown((), {3}) == [3]
    assert numbers_shown((), ()) == []
    assert numbers_shown((2, 5), range(1, 13)) == [2, 5]


@pytest.mark.parametrize(
    ("present", "choices"), [((), "no injection was found"), ((1, 2), "there are 1 to 2")]
)
def test_one_that_is_not_there_is_named(present: tuple[int, ...], choices: str) -> None:
    with pytest.raises(UserError, match="no injection 3") as error:
        numbers_shown((3,), present)
    assert choices in error.value.remedy
