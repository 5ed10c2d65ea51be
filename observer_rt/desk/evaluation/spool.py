"""Spools things of any number to a temporary file, from which they are read back in any order."""

import pickle
import tempfile
import weakref
from array import array
from collections.abc import Callable, Sequence
from typing import Any, Generic, TypeVar

T = TypeVar("T")


class Spool(Sequence[T], Generic[T]):
    """Things appended one after another and read back as often as wanted; gone with the process."""

    def __init__(self, in_memory: int = 1) -> None:
        """in_memory: number of items held there before they go to the file together, and after they come back."""
        self._file = tempfile.TemporaryFile()  # noqa: SIM115 - as long as the spool
        weakref.finalize(self, self._file.close)
        self._starts = array("q")  # of blocks of so many
        self._size = in_memory
        self._newest: list[T] = []
        self._read: tuple[int, list[T]] = -1, []  # the last block that came back

    def append(self, thing: T) -> None:
        """Keep it; it is not to change any more."""
        self._newest.append(thing)
        if len(self._newest) == self._size:
            self._file.seek(0, 2)
            self._starts.append(self._file.tell())
            pickle.dump(self._newest, self._file, pickle.HIGHEST_PROTOCOL)
            self._newest = []

    def __reduce__(self) -> tuple[Callable[..., "Spool[T]"], tuple[int, list[T]]]:
        return _filled, (self._size, list(self))

    def __len__(self) -> int:
        return len(self._starts) * self._size + len(self._newest)

    def __getitem__(self, number: Any) -> Any:
        if isinstance(number, slice):
            return [self[each] for each in range(len(self))[number]]
        block, position = divmod(range(len(self))[number], self._size)
        if block == len(self._starts):
            return self._newest[position]
        if block != self._read[0]:
            self._file.seek(self._starts[block])
            self._read = block, pickle.load(self._file)
        return self._read[1][position]


def _filled(in_memory: int, things: Sequence[T]) -> Spool[T]:
    """A copy, in a file of its own."""
    spool: Spool[T] = Spool(in_memory)
    for thing in things:
        spool.append(thing)
    return spool
