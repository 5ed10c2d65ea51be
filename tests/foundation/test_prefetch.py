"""Things made beside whoever uses them: all of them, in order, and their errors in time."""

import threading
from collections.abc import Iterator

import pytest

from observer_rt.desk.evaluation.run import prefetch


def test_all_come_in_order() -> None:
    assert list(prefetch(range(100))) == list(range(100))
    assert list(prefetch(())) == []


def test_the_next_is_made_while_one_is_used_and_no_more() -> None:
    made: list[int] = []
    third = threading.Event()

    def things() -> Iterator[int]:
        for number in range(9):
            made.append(number)
            if number == 2:
                third.set()
            yield number

    coming = prefetch(things())
    assert next(coming) == 0
    assert next(coming) == 1
    assert third.wait(5.0)  # without being asked for
    assert made == [0, 1, 2]
    coming.close()  # type: ignore[attr-defined]
    assert made == [0, 1, 2]


def test_an_error_comes_when_its_turn_has_come() -> None:
    def failing() -> Iterator[int]:
        yield 1
        raise ValueError("broken")

    coming = prefetch(failing())
    assert next(coming) == 1
    with pytest.raises(ValueError, match="broken"):
        next(coming)
