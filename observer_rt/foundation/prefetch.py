"""Prefetches from an iterator in a thread beside whoever uses it."""

from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Thing = TypeVar("Thing")


def ahead(things: Iterable[Thing]) -> Iterator[Thing]:
    """The same in the same order; while one is used the next is made in a thread, where that lets others run.

    Raises what making one raises, when its turn has come.
    """
    waiting = iter(things)
    with ThreadPoolExecutor(1, "ahead") as beside:
        coming = beside.submit(next, waiting, _END)
        while not isinstance(thing := coming.result(), _End):
            coming = beside.submit(next, waiting, _END)
            yield thing


class _End:
    """In the place of a thing, where there is none any more."""


_END = _End()
