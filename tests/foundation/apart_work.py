"""What `test_sandbox.py` has done apart from it."""

import os
import signal
import stat
import sys
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from observer_rt.foundation.errors import UserError


def lines(path: Path) -> Iterator[str]:
    yield from path.read_text().splitlines()


ARRAYS = (
    np.arange(6.0).reshape(2, 3).T,
    np.array([True, False]),
    np.array(["2026-11-25", "NaT"], "datetime64[ns]"),
    np.array(["a", "longer"]),
    np.array([(1, [2, 3], "b")], [("id", np.uint32), ("data", np.uint8, 2), ("channel", "U16")]),
    np.array(5),
    np.empty((0, 4), np.float32),
)


class NamedValue(NamedTuple):
    """Comes as a list."""

    number: int
    text: str


def plain(path: Path) -> Iterator[Any]:
    yield str(path), True, None, float("nan"), {"type": (1, NamedValue(2, "a")), "fields": {}}, *ARRAYS


def an_object(path: Path) -> Iterator[Any]:
    yield [path]


def objects(path: Path) -> Iterator[Any]:
    yield np.array([path], object)


def numbered(path: Path) -> Iterator[Any]:
    yield {1: "a"}


def a_set(path: Path) -> Iterator[Any]:
    yield {1}


def taken_over(path: Path) -> Iterator[Any]:
    """What a worker in the hands of the file does: it writes bytes of the file's as an answer."""
    for link in Path("/proc/self/fd").iterdir():
        number = int(link.name)
        with suppress(OSError):
            if number > 2 and stat.S_ISFIFO(os.fstat(number).st_mode):
                os.write(number, path.read_bytes())
    os.kill(os.getpid(), signal.SIGKILL)
    yield


def noisy(path: Path) -> Iterator[int]:
    print("something")
    print("something else", file=sys.stderr)
    os.system("echo from the shell")
    yield 1


def crashing(path: Path) -> Iterator[int]:
    yield 1
    os.abort()


def refusing(path: Path) -> Iterator[int]:
    yield 1
    raise UserError(str(path), "is damaged", "write it again")


def failing(path: Path) -> Iterator[int]:
    yield 1 // int(path == path.parent)


def endless(path: Path) -> Iterator[int]:
    yield 1
    while True:
        pass


def greedy(path: Path) -> Iterator[int]:
    yield len(bytearray(1 << 40))


def littering(path: Path) -> Iterator[str]:
    descriptor, name = tempfile.mkstemp()
    os.close(descriptor)
    yield name
    os.kill(os.getpid(), signal.SIGKILL)


def parent(path: Path) -> Iterator[int]:
    yield os.getppid()
