"""What `test_apart.py` has done apart from it."""

import os
import signal
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from observer_rt.foundation.errors import UserError


def lines(path: Path) -> Iterator[str]:
    yield from path.read_text().splitlines()


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
    raise UserError(str(path), "is damaged", "mend it")


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
