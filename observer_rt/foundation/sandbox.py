"""Runs work that may crash in a process of its own: nothing it meets ends the caller or reaches its screen.

For libraries that read what others wrote with code that trusts it. One server process imports what the work needs,
once, and forks a worker for every piece of work. What a worker leaves behind is deleted with its folder.
"""

import atexit
import os
import pickle
import resource
import signal
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

from observer_rt.foundation.errors import UserError

CPU_SECONDS = 5  # for any file; damaged ones can lead a reader in circles
SECONDS_PER_BYTE = 4e-6  # more than reading takes
MEMORY = 4 << 30  # bytes, for any file
MEMORY_PER_BYTE = 8
LONGEST_REQUEST = 1 << 16
_PACKAGE_FOLDER = Path(__file__).parents[2]


class WorkerError(Exception):
    """End of the work without a result; the text states how."""


class _Request(NamedTuple):
    """`function` of `module`, a generator, is to be called with the path of a file and further arguments."""

    module: str
    function: str
    path: Path
    arguments: tuple[Any, ...]
    working_folder: str
    scratch: str
    cpu_seconds: int


class _Item(NamedTuple):
    value: Any


class _Failure(NamedTuple):
    kind: type[Exception]
    arguments: tuple[Any, ...]


def run_apart(module: str, function: str, path: Path, *arguments: Any) -> Iterator[Any]:
    """Run a generator function of a module on a file, in a process of its own; all it yields must be picklable.

    Raises what it raises if that is a `UserError` or `OSError`, `WorkerError` however else it ends early.
    """
    with tempfile.TemporaryDirectory(prefix="observer_rt-", ignore_cleanup_errors=True) as scratch:
        answers = _ask(_Request(module, function, path, arguments, str(Path.cwd()), scratch, CPU_SECONDS))
        with os.fdopen(answers, "rb") as pipe:
            while True:
                try:
                    answer = pickle.load(pipe)
                except (EOFError, pickle.UnpicklingError):
                    raise WorkerError("what reads it crashed, or did not come to an end") from None
                if answer is None:
                    return
                if isinstance(answer, _Failure):
                    raise answer.kind(*answer.arguments)
                yield answer.value


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
        answers, theirs = os.pipe()
        try:
            socket.send_fds(self._socket, [pickle.dumps(request)], [theirs])
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
    """Hand over a request, to a new server where there is none or it has died."""
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
        request: _Request = pickle.loads(data)
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
                for value in work(request.path, *request.arguments):
                    pickle.dump(_Item(value), pipe, pickle.HIGHEST_PROTOCOL)
                    pipe.flush()
                pickle.dump(None, pipe)
            except UserError as error:
                pickle.dump(_Failure(UserError, (error.place, error.problem, error.remedy)), pipe)
            except OSError as error:
                pickle.dump(_Failure(type(error), error.args), pipe)
            except Exception as error:  # whatever foreign code raises
                pickle.dump(_Failure(WorkerError, (f"{type(error).__name__}: {error}",)), pipe)
    finally:
        os._exit(0)


def _limit(request: _Request) -> None:
    """Bound the time and the memory of this process by the size of the file it reads."""
    size = request.path.stat().st_size if request.path.is_file() else 0
    limits = [
        (resource.RLIMIT_CPU, request.cpu_seconds + round(size * SECONDS_PER_BYTE)),
        (resource.RLIMIT_CORE, 0),
    ]
    if "libasan" not in os.environ.get("LD_PRELOAD", ""):  # which takes terabytes of addresses for itself
        limits.append((resource.RLIMIT_DATA, MEMORY + size * MEMORY_PER_BYTE))
    for kind, limit in limits:
        highest = resource.getrlimit(kind)[1]
        resource.setrlimit(
            kind, (limit if highest == resource.RLIM_INFINITY else min(limit, highest), highest)
        )
