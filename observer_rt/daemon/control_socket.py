"""The daemon's one local socket: a request is a line of JSON, its answer one or bytes, for whoever may open its file.

It stands beside the lock of the file that the daemon keeps, else beside its bench file: whoever sees the file sees
the socket, even through a folder shared with a container. It is below `RUN` where the daemon may write neither. A
request has its name in `request`; an answer with `error` refuses. Clients of another user and group may only look.
"""

import errno
import json
import os
import pwd
import socket
import struct
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from socketserver import StreamRequestHandler, ThreadingMixIn, UnixStreamServer
from threading import BoundedSemaphore, Thread
from typing import Any

from observer_rt.config.bench import BenchInjector
from observer_rt.daemon.lock import is_written
from observer_rt.daemon.snapshot import SNAPSHOT, line_of
from observer_rt.foundation.errors import ObserverError, RunError, UserError
from observer_rt.foundation.files import is_at

OBSERVER = "observer"  # in the folder of evidence: its lock names the process that keeps it
MOST_CLIENTS = 16  # at once of our user and group, with root, and as many others; what is beyond is closed
LONGEST = 1 << 16  # bytes of a line
IDLE = 30.0  # s that a client may be silent, or not read
PATIENCE = 60.0  # s that an answer may take
EVERYBODY = 0o666
RUN = Path("/run/observer-rt")  # made by the unit of systemd

_CREDENTIALS = struct.Struct("3i")  # of a client: process, user, group

Message = Mapping[str, Any]
Requests = Mapping[str, Callable[[Message], Message | Iterator[bytes]]]
"""Functions that answer, by the name of the request: called in a client's thread, they may raise `ObserverError`.

An answer is a line of JSON; or pieces, the first of which is one, and says how many bytes follow.
"""


def socket_places(injector: BenchInjector, state: Path | None = None) -> tuple[Path, ...]:
    """Files beside which a daemon of an injector tries to have its socket, in this order.

    state: of the command line; one that the bench file does not name is left out, for no client could find it.
    """
    kept = injector.state if state in (None, injector.state) else None
    path, evidence = injector.file.path, injector.evidence and injector.evidence / OBSERVER
    by_bench = path.with_name(".".join(filter(None, (path.name, injector.name))))
    below = RUN / injector.name / str(path.resolve()).strip("/").replace("/", "-")
    return tuple(filter(None, (evidence, kept, by_bench, below)))


@contextmanager
def control_socket(kept: Path, requests: Requests, say: Callable[[str], None] = lambda _: None) -> Iterator[None]:
    """Answer requests at the socket of a file; `say` takes warnings. Raises OSError without a socket of its own."""
    with _address(kept) as address:
        with suppress(FileNotFoundError, ConnectionRefusedError), socket.socket(socket.AF_UNIX) as other:
            other.connect(address)
            raise OSError(errno.EADDRINUSE, "another daemon answers there")
        Path(address).unlink(missing_ok=True)  # left behind by a process that was killed
        with _SocketServer(address, requests, say) as server:
            path = Path(os.path.realpath(kept) + ".socket")
            own = path.stat()
            Thread(target=server.serve_forever, args=(0.1,), name="control socket", daemon=True).start()
            try:
                yield
            finally:
                server.shutdown()
                with suppress(OSError):
                    if is_at(path, own):
                        path.unlink()


def daemon_connection(kept: Path) -> socket.socket | None:
    """Connection to the daemon that keeps a file; None: there is no such daemon.

    Raises `UserError` for a daemon that may not be asked, `RunError` for one that takes no requests.
    """
    daemon = socket.socket(socket.AF_UNIX)
    try:
        with _address(kept) as address:
            daemon.settimeout(PATIENCE)
            daemon.connect(address)
            return daemon
    except (FileNotFoundError, ConnectionRefusedError):
        if not is_written(kept):
            return None
        raise RunError(
            f"the daemon that keeps {kept} takes no requests: it is starting, or of an earlier version\n"
            "  remedy: try again, else restart it"
        ) from None
    except PermissionError:
        problem = f"is kept by a daemon of user {_owner(kept)}, who alone may ask it, with the group"
        raise UserError(str(kept), problem, "repeat the command as that user, or with sudo") from None
    except OSError:
        raise _no_answer(kept) from None


def ask(kept: Path, request: Message) -> Message | None:
    """Answer of the daemon that keeps a file, a line; None: there is no such daemon.

    Raises `UserError` for a daemon that refuses, or may not be asked, `RunError` for one that does not answer.
    """
    if (daemon := daemon_connection(kept)) is None:
        return None
    try:
        with daemon, daemon.makefile("rwb") as stream:
            stream.write(line_of(request))
            stream.flush()
            answer = json.loads(stream.readline(LONGEST))
    except (OSError, ValueError):
        raise _no_answer(kept) from None
    if "error" in answer:
        raise UserError(str(kept), f"its daemon refuses: {answer['error']}", "see the daemon's log")
    return dict(answer)


class _SocketServer(ThreadingMixIn, UnixStreamServer):
    """Takes a limited number of clients, each in a thread of its own, which ends with its client."""

    daemon_threads = True
    request_queue_size = 4 * MOST_CLIENTS
    block_on_close = False

    def __init__(self, address: str, requests: Requests, say: Callable[[str], None]) -> None:
        self.requests = requests
        self._say = say
        self._has_warned = False
        self._places = {is_own: BoundedSemaphore(MOST_CLIENTS) for is_own in (False, True)}
        self._clients: set[socket.socket] = set()
        super().__init__(address, _Client)
        Path(address).chmod(EVERYBODY)

    def verify_request(self, request: Any, client_address: object) -> bool:
        """Whether there is room for one more of its kind."""
        has_room = self._places[_is_own(request)].acquire(blocking=False)
        if not (has_room or self._has_warned):
            self._has_warned = True
            process, user, _ = _credentials(request)
            self._say(
                f"warning: more than {MOST_CLIENTS} clients at the control socket at once, the last one process "
                f"{process} of user {user}: more are closed\n  remedy: see what opens them"
            )
        return has_room

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Serve a client until it goes."""
        places = self._places[_is_own(request)]
        self._clients.add(request)
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._clients.discard(request)
            places.release()

    def server_close(self) -> None:
        """Close the socket and the connections of all clients."""
        super().server_close()
        for client in tuple(self._clients):
            with suppress(OSError):
                client.shutdown(socket.SHUT_RDWR)


class _Client(StreamRequestHandler):
    timeout = IDLE
    server: _SocketServer

    def handle(self) -> None:
        """Answer one line after another."""
        with suppress(OSError):  # it is gone, or silent
            while (line := self.rfile.readline(LONGEST)).endswith(b"\n"):
                answer = self._answer(line)
                self.wfile.writelines([line_of(answer)] if isinstance(answer, Mapping) else answer)

    def _answer(self, line: bytes) -> Message | Iterator[bytes]:
        try:
            request = json.loads(line)
            answer = self.server.requests[request["request"]]
            if request["request"] != SNAPSHOT and not _is_own(self.request):
                user = pwd.getpwuid(os.geteuid()).pw_name
                return {"error": f"user {user} and its group alone may ask for that; repeat it with sudo"}
            return answer(request)
        except ObserverError as error:
            return {"error": str(error)}
        except (ValueError, ArithmeticError, KeyError, TypeError, RecursionError):
            return {"error": f"this is no request; known: {', '.join(self.server.requests)}"}


def _credentials(client: socket.socket) -> tuple[int, int, int]:
    credentials = client.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    process, user, group = _CREDENTIALS.unpack(credentials)
    return process, user, group


def _is_own(client: socket.socket) -> bool:
    """Whether a client is of this process's user or group, or the administrator."""
    _, user, group = _credentials(client)
    return user in (0, os.geteuid()) or group == os.getegid()


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
    path = Path(os.path.realpath(kept) + ".socket")
    for ancestor in (path, *path.parents):
        with suppress(OSError, KeyError):
            return pwd.getpwuid(ancestor.stat().st_uid).pw_name
    return "unknown"


def _no_answer(kept: Path) -> RunError:
    return RunError(f"the daemon that keeps {kept} does not answer\n  remedy: see its log; restart it if it hangs")
