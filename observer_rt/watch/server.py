"""`observer-rt monitor`: the page served until Ctrl-C, and a WebSocket for each browser that has it open."""

import asyncio
import gc
import hmac
import json
import re
import secrets
import socket
import sys
from contextlib import suppress
from ipaddress import ip_address
from pathlib import Path

from rich.console import Console
from tornado.httpserver import HTTPServer
from tornado.ioloop import PeriodicCallback
from tornado.netutil import bind_sockets
from tornado.web import Application, RequestHandler, StaticFileHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from observer_rt.config.bench import Bench
from observer_rt.foundation.console import say, stop_on_signals
from observer_rt.foundation.errors import RunError
from observer_rt.watch.page.session import Session
from observer_rt.watch.watching import FrameSource, Watching

_FILES = Path(__file__).parent / "page" / "static"
_COOKIE = "observer_rt"
_LOOK_EVERY = 10  # ms: whether something is new and a browser through with the last drawing
_STOP_EVERY = 0.1  # s between two looks at the stop signal
_TURN = 0.0002  # s that the listening thread may go on while the page waits to be served


class _Guarded(RequestHandler):
    """Serves whoever has the token of the page, by its address at first, then by a cookie; all if it has none."""

    def prepare(self) -> None:
        """Refuse a request without it."""
        token = self.application.settings["token"]
        if token is None:
            return
        if hmac.compare_digest(self.get_query_argument("token", "").encode(), token.encode()):
            self.set_cookie(_COOKIE, token, httponly=True, samesite="Strict")
        elif not hmac.compare_digest((self.get_cookie(_COOKIE) or "").encode(), token.encode()):
            self.set_status(403)
            self.finish(
                "Open the address with the token that `observer-rt monitor` has written on its terminal.\n"
            )


class _PageFiles(_Guarded, StaticFileHandler):
    def set_extra_headers(self, path: str) -> None:
        self.set_header("Cache-Control", "no-cache")  # else a browser may keep those of an older version


class _Channel(_Guarded, WebSocketHandler):
    """Brings what is new to a browser, which answers each message with its number once it is drawn."""

    def initialize(self, watching: Watching, folder: Path) -> None:
        """folder: where injections are saved."""
        self._session = Session(watching, folder)
        self._looking = PeriodicCallback(self._draw, _LOOK_EVERY)

    def open(self) -> None:
        """The browser has the page."""
        self.set_nodelay(True)  # else most drawings wait 40 ms for the receipt of the packet before
        self._looking.start()

    def on_message(self, message: str | bytes) -> None:
        """A button was pressed, or something drawn."""
        self._session.take(*json.loads(message))
        self._draw()

    def on_close(self) -> None:
        """The browser is gone."""
        self._looking.stop()

    def _draw(self) -> None:
        if (message := self._session.message()) is not None:
            with suppress(WebSocketClosedError):  # which `on_close` is about to hear
                self.write_message(message, binary=True)


def serve_page(
    bench: Bench, source: FrameSource, address: str, port: int, folder: Path, console: Console
) -> None:
    """Listen to a source and serve its page until SIGINT or SIGTERM; port 0: one that is free; folder: of `Save`.

    Raises `RunError` for a port that is taken.
    """
    asyncio.run(_serve(Watching(bench, source), address, port, folder, console))


async def _serve(watching: Watching, address: str, port: int, folder: Path, console: Console) -> None:
    handlers = [
        ("/drawings", _Channel, {"watching": watching, "folder": folder}),
        ("/(.*)", _PageFiles, {"path": _FILES, "default_filename": "page.html"}),
    ]
    try:
        is_local = ip_address(socket.gethostbyname(address)).is_loopback
        token = None if is_local else secrets.token_urlsafe(12)
        application = Application(token=token)
        # a foreign page whose name leads here by its own name server is not served
        names = rf"(localhost|127\.0\.0\.1|{re.escape(address)})" if is_local else ".*"
        application.add_handlers(names, handlers)
        sockets = bind_sockets(port, address, socket.AF_INET)
    except OSError as error:
        raise RunError(
            f"--port {port}: {address} cannot be listened at ({error.strerror})\n"
            "  remedy: choose another port, or --port 0 for any that is free"
        ) from error
    HTTPServer(application).add_sockets(sockets)
    with stop_on_signals() as stop:
        watching.start()
        asked = "" if token is None else f"?token={token}"
        say(console, f"http://{address}:{sockets[0].getsockname()[1]}/{asked} (Ctrl-C ends it)")
        sys.setswitchinterval(_TURN)
        gc.freeze()  # what is loaded stays: going through all of it now and then would hold up drawings
        try:
            while not stop.is_set():
                await asyncio.sleep(_STOP_EVERY)
        finally:
            watching.close()
