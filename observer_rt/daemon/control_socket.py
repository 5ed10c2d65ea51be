"""The daemon's one local socket: a request and its answer are a line of JSON each, for whoever may open its file.

It stands beside the lock of what the daemon keeps, so that a process sees both if it sees one, also through a folder
that is shared with a container. A request is an object that names what is asked for as `request`; an answer that has
`error` refuses.
"""

import json
import os
import pwd
import socket
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from socketserver import StreamRequestHandler, ThreadingMixIn, UnixStreamServer
from threading import BoundedSemaphore, Thread
from typing import Any

from observer_rt.daemon.persistence.journal import is_at
from observer_rt.daemon.persistence.keeper import is_written
from observer_rt.foundation.errors import ObserverError, RunError, UserError

MOST_CLIENTS = 8  # at once; what is beyond is closed
LONGEST = 1 << 16  # bytes of a line
IDLE = 30.0  # s that a client may be silent, or not read
PATIENCE = 60.0  # s that an answer may take
OWNER_AND_GROUP = 0o660

Message = Mapping[str, Any]
Requests = Mapping[str, Callable[[Message], Message]]
"""Functions that answer, by the name of the request: called in a client's thread, they may raise `ObserverError`."""


@contextmanager
def control_socket(kept: Path, requests: Requests) -> Iterator[None]:
    """Answer requests at the socket of a file that this process has locked. Raises OSError where none can be made."""
    with _address(kept) as address:
        Path(address).unlink(missing_ok=True)  # the lock is ours: left behind by a process that was killed
        with _SocketServer(address, requests) as server:
            path = Path(os.path.realpath(kept) + ".socket")
            own = path.stat()
            thread = Thread(target=server.serve_forever, args=(0.1,), name="control socket", daemon=True)
            thread.start()
            try:
                yield
            finally:
                server.shutdown()
                with suppress(OSError):
                    if is_at(path, own):
                        path.unlink()


def ask(kept: Path, request: Message) -> Message | None:
    """Answer of the daemon that keeps a file; None: there is no such daemon.

    Raises `UserError` for a daemon that refuses, or may not be asked, `RunError` for one that does not answer.
    """
    try:
        with socket.socket(socket.AF_UNIX) as daemon, _address(kept) as address:
            daemon.settimeout(PATIENCE)
            daemon.connect(address)
            daemon.sendall(json.dumps(request).encode() + b"\n")
            with daemon.makefile("rb") as lines:
                answer = json.loads(lines.readline(LONGEST))
    except (FileNotFoundError, ConnectionRefusedError):
        if not is_written(kept):
            return None
        raise RunError(
            f"the daemon that keeps {kept} takes no requests: it is starting, or of an earlier version\n"
            "  remedy: try again, else restart it"
        ) from None
    except PermissionError:
        raise UserError(
            str(kept),
            f"is kept by a daemon of user {_owner(kept)}, who alone may ask it, with the group",
            "repeat the command as that user, or with sudo",
        ) from None
    except (OSError, ValueError):
        raise RunError(
            f"the daemon that keeps {kept} does not answer\n  remedy: see its log; restart it if it hangs"
        ) from None
    if "error" in answer:
        raise UserError(str(kept), f"its daemon refuses: {answer['error']}", "see the daemon's log")
    return dict(answer)


class _SocketServer(ThreadingMixIn, UnixStreamServer):
    """Takes a limited number of clients, each in a thread of its own, which outlives nothing but its client."""

    daemon_threads = True
    request_queue_size = 4 * MOST_CLIENTS
    block_on_close = False

    def __init__(self, address: str, requests: Requests) -> None:
        self.requests = requests
        self._places = BoundedSemaphore(MOST_CLIENTS)
        super().__init__(address, _Client)
        Path(address).chmod(OWNER_AND_GROUP)

    def verify_request(self, request: object, client_address: object) -> bool:
        """Whether there is room for one more."""
        return self._places.acquire(blocking=False)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Serve a client until it goes."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._places.release()


class _Client(StreamRequestHandler):
    timeout = IDLE
    server: _SocketServer

    def handle(self) -> None:
        """Answer one line after another."""
        with suppress(OSError):  # it is gone, or silent
            while (line := self.rfile.readline(LONGEST)).endswith(b"\n"):
                self.wfile.write(json.dumps(self._answer(line)).encode() + b"\n")

    def _answer(self, line: bytes) -> Message:
        try:
            request = json.loads(line)
            answer = self.server.requests[request["request"]]
        except (ValueError, KeyError, TypeError, RecursionError):
            return {"error": f"this is no request; known: {', '.join(self.server.requests)}"}
        try:
            return answer(request)
        except ObserverError as error:
            return {"error": str(error)}


@contextmanager
def _address(kept: Path) -> Iterator[str]:
    """Address of a file's socket, through its folder's descriptor: a path itself may have 107 bytes only."""
    path = Path(os.path.realpath(kept) + ".socket")
    folder = os.open(path.parent, os.O_PATH | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        yield f"/proc/self/fd/{folder}/{path.name}"
    finally:
        os.close(folder)


def _owner(kept: Path) -> str:
    """The user whose daemon keeps a file, as far as it can be told."""
    path = Path(os.path.realpath(kept) + ".socket")
    for place in (path, *path.parents):
        with suppress(OSError, KeyError):
            return pwd.getpwuid(place.stat().st_uid).pw_name
    return "unknown"
