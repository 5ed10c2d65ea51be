"""Runs work that may crash in a process of its own: nothing it meets ends the caller or reaches its screen.

For libraries that read what others wrote with code that trusts it. One server process imports what the work needs,
once, and forks a worker for every piece of work. What a worker leaves behind is deleted with its folder. A worker may
be in the hands of the file it reads: what it says is read as plain data only, and callers check it (`checked`).

A message is JSON, then the arrays that it stands for, each as a file of numpy (.npy): every part is its length (8
bytes) and its bytes. It may hold None, bool, int, float and str; lists, tuples (which come as lists) and dictionaries
of these with keys of text; numpy arrays of anything but objects. Reading one never executes anything.
"""

import atexit
import json
import os
import resource
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import suppress
from enum import StrEnum
from importlib import import_module
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, NoReturn, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from observer_rt.foundation.errors import UserError

CPU_SECONDS = 5  # for any file; damaged ones can lead a reader in circles
SECONDS_PER_BYTE = 4e-6  # more than reading takes
MEMORY = 4 << 30  # bytes, for any file
MEMORY_PER_BYTE = 8
LONGEST_REQUEST = 1 << 16
_PACKAGE_FOLDER = Path(__file__).parents[2]
_LENGTH = struct.Struct("<Q")
_ARRAY, _FIELDS = "array", "fields"  # what stands for the next array, and for a dictionary
T = TypeVar("T")


class WorkerError(Exception):
    """End of the work without a result; the text states how."""


class _Request(NamedTuple):
    """`function` of `module`, a generator, is to be called with the path of a file and further arguments."""

    module: str
    function: str
    path: str
    arguments: tuple[Any, ...]
    working_folder: str
    scratch: str
    cpu_seconds: int


class _Kind(StrEnum):
    """What a worker says: a value, the end of all values, or why there are no more."""

    ITEM = "item"
    END = "end"
    USER_ERROR = "user error"
    FAILURE = "failure"


_USER_ERROR: TypeAdapter[tuple[str, str, str]] = TypeAdapter(tuple[str, str, str])


def run_apart(module: str, function: str, path: Path, *arguments: Any) -> Iterator[Any]:
    """Run a generator function of a module on a file, in a process of its own.

    It may yield what a message may hold; anything else is a `TypeError` of the function. The arguments are the same,
    but for arrays.

    Raises what it raises if that is a `UserError`, `WorkerError` however else it ends early.
    """
    with tempfile.TemporaryDirectory(prefix="observer_rt-", ignore_cleanup_errors=True) as scratch:
        request = _Request(module, function, str(path), arguments, str(Path.cwd()), scratch, CPU_SECONDS)
        with os.fdopen(_ask(request), "rb") as pipe:
            while True:
                kind, content = _answer(pipe)
                if kind is _Kind.END:
                    return
                if kind is _Kind.USER_ERROR:
                    raise UserError(*checked(_USER_ERROR, content))
                if kind is _Kind.FAILURE:
                    raise WorkerError(str(content))
                yield content


def checked(kind: TypeAdapter[T], answer: Any) -> T:
    """An answer as what it must be. Raises `WorkerError` for anything else."""
    try:
        return kind.validate_python(answer)
    except ValidationError as error:
        problem = error.errors(include_url=False, include_input=False)[0]
        raise WorkerError(f"its reader gave something else than was asked for: {problem['msg']}") from None


def _answer(pipe: BinaryIO) -> tuple[_Kind, Any]:
    if not (start := pipe.read(_LENGTH.size)):
        raise WorkerError("what reads it crashed, or did not come to an end")
    try:
        kind, content = _unpacked(json.loads(_read_part(pipe, start)), pipe)
        return _Kind(kind), content
    except (struct.error, ValueError, TypeError, LookupError, RecursionError, OverflowError, MemoryError) as error:
        raise WorkerError(f"what reads it gave no answer that can be read: {error}") from None


def _size(path: Path) -> int:
    return path.stat().st_size if path.is_file() else 0


class _Server:
    """The process that forks the workers, and the way to it."""

    def __init__(self) -> None:
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            paths = (str(_PACKAGE_FOLDER), os.environ.get("PYTHONPATH", ""))
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-c", f"from {__name__} import serve; serve({theirs.fileno()})"],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))},
                pass_fds=(theirs.fileno(),),
                start_new_session=True,  # what is typed at the caller's terminal is for the caller
            )

    def ask(self, request: _Request) -> int:
        """The file descriptor the answers can be read from. Raises `OSError` where the server is gone."""
        message = json.dumps(request).encode()
        if len(message) > LONGEST_REQUEST:
            raise WorkerError(f"a request of {len(message)} bytes is too long")
        answers, theirs = os.pipe()
        try:
            socket.send_fds(self._socket, [message], [theirs])
        except OSError:
            os.close(answers)
            raise
        finally:
            os.close(theirs)
        return answers

    def close(self) -> None:
        """End it; workers end with their work."""
        self._socket.close()
        self._process.wait()


_server: _Server | None = None
_lock = threading.Lock()


def _ask(request: _Request) -> int:
    """Hand over a request, to a new server if none is running."""
    global _server
    with _lock:
        if _server is not None:
            with suppress(OSError):
                return _server.ask(request)
            _end_server()
        _server = _Server()
        return _server.ask(request)


@atexit.register
def _end_server() -> None:
    global _server
    if _server is not None:
        _server.close()
        _server = None


def serve(descriptor: int) -> None:
    """The server: fork a worker for each request from a socket, until that is closed."""
    requests = socket.socket(fileno=descriptor)
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for workers
    while True:
        data, descriptors, _, _ = socket.recv_fds(requests, LONGEST_REQUEST, 1)
        if not data:
            return
        request = _Request(*json.loads(data))
        with suppress(Exception):  # the worker will report it
            import_module(request.module)
        if os.fork() == 0:
            requests.close()
            _work(request, descriptors[0])
        os.close(descriptors[0])


def _work(request: _Request, answers: int) -> NoReturn:
    """Do the work and end the process, whatever happens."""
    try:
        os.chdir(request.working_folder)
        tempfile.tempdir = request.scratch
        with os.fdopen(answers, "wb") as pipe:
            _limit(request)
            try:
                work = getattr(import_module(request.module), request.function)
                for value in work(Path(request.path), *request.arguments):
                    _write_message(pipe, (_Kind.ITEM, value))
                end: tuple[Any, ...] = (_Kind.END, None)
            except UserError as error:
                end = (_Kind.USER_ERROR, (error.location, error.problem, error.remedy))
            except Exception as error:  # whatever foreign code raises
                end = (_Kind.FAILURE, f"{type(error).__name__}: {error}")
            _write_message(pipe, end)
    finally:
        os._exit(0)


def _limit(request: _Request) -> None:
    """Bound the time and the memory of this process by the size of the file it reads."""
    size = _size(Path(request.path))
    limits = [(resource.RLIMIT_CPU, request.cpu_seconds + round(size * SECONDS_PER_BYTE)), (resource.RLIMIT_CORE, 0)]
    if "libasan" not in os.environ.get("LD_PRELOAD", ""):  # which takes terabytes of addresses for itself
        limits.append((resource.RLIMIT_DATA, MEMORY + size * MEMORY_PER_BYTE))
    for kind, limit in limits:
        highest = resource.getrlimit(kind)[1]
        resource.setrlimit(kind, (limit if highest == resource.RLIM_INFINITY else min(limit, highest), highest))


def _write_message(stream: BinaryIO, value: Any) -> None:
    """Write a value. Raises `TypeError` for anything but plain data, before the first byte is written."""
    arrays: list[NDArray[Any]] = []
    parts = [json.dumps(_packed(value, arrays)).encode()]
    for array in arrays:
        np.save(file := BytesIO(), array, allow_pickle=False)
        parts.append(file.getvalue())
    for part in parts:
        stream.write(_LENGTH.pack(len(part)))
        stream.write(part)
    stream.flush()


def _read_part(stream: BinaryIO, start: bytes) -> bytes:
    """The part of a message that has a length, as it stands before it. Raises `ValueError`."""
    (length,) = _LENGTH.unpack(start)
    part = stream.read(length)
    if len(part) < length:
        raise ValueError(f"ends after {len(part)} of {length} bytes")
    return part


def _packed(value: Any, arrays: list[NDArray[Any]]) -> Any:
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, list | tuple):
        return [_packed(item, arrays) for item in value]
    if isinstance(value, dict) and all(isinstance(key, str) for key in value):
        return {_FIELDS: {key: _packed(item, arrays) for key, item in value.items()}}
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        arrays.append(value)
        return {_ARRAY: len(arrays)}
    raise TypeError(f"{type(value).__name__} is no plain data: send numbers, text, lists, dictionaries or arrays")


def _unpacked(value: Any, stream: BinaryIO) -> Any:
    """What `_packed` was given; the arrays follow each other as they do there."""
    if isinstance(value, list):
        return [_unpacked(item, stream) for item in value]
    if not isinstance(value, dict):
        return value
    if _FIELDS in value:
        return {key: _unpacked(item, stream) for key, item in value[_FIELDS].items()}
    if _ARRAY not in value:
        raise ValueError("a dictionary that stands for nothing")
    return np.load(BytesIO(_read_part(stream, stream.read(_LENGTH.size))), allow_pickle=False)
