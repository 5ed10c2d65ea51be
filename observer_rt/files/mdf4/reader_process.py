"""Processes in which asammdf reads MDF4 files: it trusts what stands in a file, and damaged ones crash it.

A server imports once, which takes a second, and forks a worker for each piece of work, since the caller may have
threads. A worker sends JSON, of a value and the names of arrays that follow as .npy files; no names end the work.
"""

import atexit
import json
import os
import resource
import signal
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import suppress
from io import BytesIO
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from pkgutil import resolve_name
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.errors import UserError, file_errors, require

READABLE = "give a complete MDF 4 measurement"
CPU_SECONDS = 5  # for any file; damaged ones can lead a reader in circles
SECONDS_PER_BYTE = 4e-6  # more than reading takes
MEMORY = 4 << 30  # bytes, for any file
MEMORY_PER_BYTE = 8
_LONGEST_REQUEST = 1 << 16

Answer = tuple[Any, dict[str, NDArray[Any]]]
"""A value as JSON may hold it, and arrays by name, of anything but objects."""


def mdf4_apart(work: str, path: Path, *arguments: Any) -> Iterator[Answer]:
    """What a generator function ("module:function") yields of an MDF4 file, called in a process of its own.

    Raises `UserError` naming the file, whatever ends the work early.
    """
    require("asammdf")
    with file_errors(path), path.open("rb"):  # whose errors are the usual ones
        size = path.stat().st_size
    limits = (CPU_SECONDS + round(size * SECONDS_PER_BYTE), MEMORY + size * MEMORY_PER_BYTE)
    with (
        tempfile.TemporaryDirectory(prefix="observer_rt-", ignore_cleanup_errors=True) as scratch,
        _ask(json.dumps((work, str(path.absolute()), arguments, scratch, *limits))) as answers,
    ):
        while True:
            try:
                value, names = json.loads(answers.recv_bytes())
                arrays = {name: np.load(BytesIO(answers.recv_bytes()), allow_pickle=False) for name in names or ()}
            except Exception:  # whatever a reader gone wrong leaves behind
                value, names = _damage("what reads it crashed, or did not come to an end"), None
            if names is None:
                break
            yield value, arrays
    if value:
        raise UserError(str(path), *value)


def _damage(problem: str) -> tuple[str, str]:
    return f"a damaged MDF file: {problem}", READABLE


_server: tuple[subprocess.Popen[bytes], socket.socket] | None = None
_lock = threading.Lock()


def _ask(request: str) -> Connection:
    """Send a request to the server, started anew if none is running; returns the connection of the answers."""
    global _server
    answers, theirs = Pipe(duplex=False)
    with theirs, _lock:
        if _server is None or _server[0].poll() is not None:
            _end_server()
            _server = _started_server()
        socket.send_fds(_server[1], [request.encode()], [theirs.fileno()])
    return answers


def _started_server() -> tuple[subprocess.Popen[bytes], socket.socket]:
    requests, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with theirs:
        process = subprocess.Popen(
            [sys.executable, "-P", "-c", f"from {__name__} import serve; serve()"],
            stdin=theirs.fileno(),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
            start_new_session=True,  # what is typed at the caller's terminal is for the caller
        )
    return process, requests


@atexit.register
def _end_server() -> None:
    global _server
    if _server is not None:
        process, requests = _server
        _server = None
        requests.close()
        process.wait()


def serve() -> None:
    """The server: fork a worker for each request from its standard input, a socket, until that is closed."""
    requests = socket.socket(fileno=os.dup(0))
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for workers
    while True:
        data, descriptors, _, _ = socket.recv_fds(requests, _LONGEST_REQUEST, 1)
        if not data:
            return
        request = json.loads(data)
        with suppress(Exception):  # the worker will report it
            resolve_name(request[0])
        if os.fork() == 0:
            _work(Connection(descriptors[0], readable=False), *request)
        os.close(descriptors[0])


def _work(
    answers: Connection, work: str, path: str, arguments: list[Any], scratch: str, seconds: int, memory: int
) -> NoReturn:
    tempfile.tempdir = scratch
    try:
        _limit(seconds, memory)
        end = None
        try:
            for value, arrays in resolve_name(work)(Path(path), *arguments):
                _send(answers, value, arrays)
        except UserError as error:
            end = error.problem, error.remedy
        except Exception as error:  # whatever foreign code raises
            end = _damage(f"{type(error).__name__}: {error}")
        answers.send_bytes(json.dumps((end, None)).encode())
    finally:
        os._exit(0)


def _limit(seconds: int, memory: int) -> None:
    """Bound the time of the processor and the memory [bytes] of this process."""
    limits = {resource.RLIMIT_CPU: seconds, resource.RLIMIT_CORE: 0, resource.RLIMIT_DATA: memory}
    if "libasan" in os.environ.get("LD_PRELOAD", ""):  # which takes terabytes of addresses for itself
        del limits[resource.RLIMIT_DATA]
    for kind, limit in limits.items():
        highest = resource.getrlimit(kind)[1]
        resource.setrlimit(kind, (limit if highest == resource.RLIM_INFINITY else min(limit, highest), highest))


def _send(answers: Connection, value: Any, arrays: dict[str, NDArray[Any]]) -> None:
    """Send a part. Raises `TypeError` or `ValueError` for what it may not hold, before the first byte."""
    files = [BytesIO() for _ in arrays]
    for file, array in zip(files, arrays.values(), strict=True):
        np.save(file, array, allow_pickle=False)
    answers.send_bytes(json.dumps((value, list(arrays))).encode())
    for file in files:
        answers.send_bytes(file.getbuffer())
