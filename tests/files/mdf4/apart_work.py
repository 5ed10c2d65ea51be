"""What `test_reader_process.py` has done apart from it."""

import os
import signal
import stat
import sys
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np

from observer_rt.files.mdf4.reader_process import Answer
from observer_rt.foundation.errors import UserError

ARRAYS = {
    "numbers": np.arange(6.0).reshape(2, 3).T,
    "flags": np.array([True, False]),
    "texts": np.array(["a", "longer"]),
    "records": np.array([(1, [2, 3], "b")], [("id", np.uint32), ("data", np.uint8, 2), ("channel", "U16")]),
    "none": np.empty((0, 4), np.float32),
}


def lines(path: Path, beginning: str) -> Iterator[Answer]:
    for line in path.read_text().splitlines():
        yield beginning + line, ARRAYS


def objects(path: Path) -> Iterator[Answer]:
    yield 1, {"objects": np.array([path], object)}


def taken_over(path: Path) -> Iterator[Answer]:
    """What a worker in the hands of the file does: it writes bytes of the file's as an answer."""
    for link in Path("/proc/self/fd").iterdir():
        number = int(link.name)
        with suppress(OSError):
            if number > 2 and stat.S_ISFIFO(os.fstat(number).st_mode):
                os.write(number, path.read_bytes())
    os.kill(os.getpid(), signal.SIGKILL)
    yield 1, {}


def noisy(path: Path) -> Iterator[Answer]:
    print("something")
    print("something else", file=sys.stderr)
    os.system("echo from the shell")
    yield 1, {}


def refusing(path: Path) -> Iterator[Answer]:
    yield 1, {}
    raise UserError(str(path), "is damaged", "write it again")


def failing(path: Path) -> Iterator[Answer]:
    yield 1 // int(path == path.parent), {}


def endless(path: Path) -> Iterator[Answer]:
    yield 1, {}
    while True:
        pass


def greedy(path: Path) -> Iterator[Answer]:
    yield len(bytearray(1 << 40)), {}


def littering(path: Path) -> Iterator[Answer]:
    descriptor, name = tempfile.mkstemp()
    os.close(descriptor)
    yield name, {}
    os.abort()


def server(path: Path) -> Iterator[Answer]:
    yield os.getppid(), {}
