"""A sequence kept in a temporary file: it may be longer than memory."""

import pickle
import tempfile
from array import array
from collections.abc import Iterator, Sequence
from typing import Generic, TypeVar, overload

T = TypeVar("T")


class Spool(Sequence[T], Generic[T]):
    """Things appended one after another and read back as often as wanted; gone with the process."""

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile()  # noqa: SIM115 - as long as the spool
        self._starts = array("q")

    def append(self, thing: T) -> None:
        """Keep it, as it is now."""
        self._file.seek(0, 2)
        self._starts.append(self._file.tell())
        pickle.dump(thing, self._file, pickle.HIGHEST_PROTOCOL)

    def __len__(self) -> int:
        return len(self._starts)

    def __iter__(self) -> Iterator[T]:
        return (self[number] for number in range(len(self)))

    @overload
    def __getitem__(self, number: int) -> T: ...

    @overload
    def __getitem__(self, number: slice) -> list[T]: ...

    def __getitem__(self, number: int | slice) -> T | list[T]:
        if isinstance(number, slice):
            return [self[each] for each in range(len(self))[number]]
        self._file.seek(self._starts[number])
        thing: T = pickle.load(self._file)
        return thing
