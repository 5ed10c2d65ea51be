"""`observer-rt monitor`: the page served until Ctrl-C, and a WebSocket for each browser that has it open."""

import asyncio
import gc
import hmac
import re
import secrets
import socket
import time
from contextlib import suppress
from ipaddress import ip_address
from pathlib import Path
from typing import Any

from rich.console import Console
from tornado.httpserver import HTTPServer
from tornado.ioloop import PeriodicCallback
from tornado.netutil import bind_sockets
from tornado.web import Application, RequestHandler, StaticFileHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from observer_rt.config.bench import Bench
from observer_rt.desk.live_page.reading import Watching
from observer_rt.desk.live_page.saver import Saver
from observer_rt.desk.live_page.session import Session, read_button
from observer_rt.foundation.console import say
from observer_rt.foundation.errors import RunError
from observer_rt.foundation.stop_request import stop_on_signals

_FILES = Path(__file__).parent / "static"
_COOKIE = "observer_rt"
_ALIVE_EVERY = 0.5  # s after which a browser gets at least an empty message
_LOOK_EVERY = 10  # ms: whether something is new and a browser through with the last drawing
_TIMEOUT = 5.0  # s for the headers of a request, and until the next one
_LONGEST = 1000  # bytes of what a browser says
_STOP_EVERY = 0.1  # s between two looks at the stop signal


class _GuardedHandler(RequestHandler):
    """Serves browsers that have the page's token, from its address at first, then a cookie; all without a token."""

    def prepare(self) -> None:
        """Refuse a request without it."""
        token = self.application.settings["token"]
        if token is None:
            return
        if hmac.compare_digest(self.get_query_argument("token", "").encode(), token.encode()):
            self.set_cookie(_COOKIE, token, httponly=True, samesite="Strict")
        elif not hmac.compare_digest((self.get_cookie(_COOKIE) or "").encode(), token.encode()):
            self.set_status(403)
            self.finish("Open the address with the token that `observer-rt monitor` has written on its terminal.\n")


class _PageFiles(_GuardedHandler, StaticFileHandler):
    def set_extra_headers(self, path: str) -> None:
        self.set_header("Cache-Control", "no-cache")  # else a browser may keep those of an older version


class _Channel(_GuardedHandler, WebSocketHandler):
    """Sends updates to a browser, which answers each message with its number once it is drawn."""

    def initialize(self, watching: Watching, saver: Saver) -> None:
        self._session = Session(watching, saver)
        self._looking = PeriodicCallback(self._draw, _LOOK_EVERY)
        self._alive_due = 0.0  # s

    def open(self) -> None:
        self.set_nodelay(True)  # else most drawings wait 40 ms for the receipt of the packet before
        self._looking.start()

    async def on_message(self, message: str | bytes) -> None:
        """A button was pressed, or something drawn. The next message waits until others had their turn."""
        match read_button(message):
            case None:
                self.close(1008, "not of this page")
                return
            case "drawn", number, _:
                self._session.take_drawn(number)
            case button, injector, count:
                self._session.take(button, injector, count)
        self._draw()
        await asyncio.sleep(0)

    def on_close(self) -> None:
        self._looking.stop()

    def _draw(self) -> None:
        message, now = self._session.message(), time.monotonic()
        if message is None and now < self._alive_due:
            return
        self._alive_due = now + _ALIVE_EVERY
        with suppress(WebSocketClosedError):  # which `on_close` is about to hear
            sent = asyncio.ensure_future(self.write_message(message or b"", binary=True))
            # the socket may be closed before all of it is sent: nobody waits to hear of that
            sent.add_done_callback(lambda done: done.cancelled() or done.exception())


def serve_page(bench: Bench, address: str, port: int, folder: Path, console: Console) -> None:
    """Read the daemons of a bench and serve their page until SIGINT or SIGTERM.

    port: 0: one that is free; folder: of `Save`. Raises `RunError` for a taken port.
    """
    watching, saver = Watching(bench), Saver(folder)
    handlers = [
        ("/drawings", _Channel, {"watching": watching, "saver": saver}),
        (r"/([\w./-]*)", _PageFiles, {"path": _FILES, "default_filename": "page.html"}),
    ]
    try:
        asyncio.run(_serve(handlers, address, port, console))
    finally:
        watching.close()
        saver.close()


async def _serve(handlers: list[Any], address: str, port: int, console: Console) -> None:
    try:
        ip = ip_address(socket.gethostbyname(address))
        token = None if ip.is_loopback else secrets.token_urlsafe(12)
        application = Application(token=token, websocket_max_message_size=_LONGEST, log_function=lambda _: None)
        # a foreign page whose name leads here by its own name server is not served
        names = rf"(localhost|127\.0\.0\.1|{re.escape(address)})" if ip.is_loopback else ".*"
        application.add_handlers(names, handlers)
        sockets = bind_sockets(port, address, socket.AF_INET)
    except OSError as error:
        raise RunError(
            f"--port {port}: {address} cannot be listened at ({error.strerror})\n"
            "  remedy: choose another port, or --port 0 for any that is free"
        ) from error
    server = HTTPServer(application, idle_connection_timeout=_TIMEOUT, body_timeout=_TIMEOUT, max_body_size=_LONGEST)
    server.add_sockets(sockets)
    with stop_on_signals() as stop:
        asked = "" if token is None else f"?token={token}"
        host = socket.gethostname() if ip.is_unspecified else address
        say(console, f"http://{host}:{sockets[0].getsockname()[1]}/{asked} (Ctrl-C ends it)")
        gc.freeze()  # what is loaded stays: going through all of it now and then would hold up drawings
        while not stop.is_set():
            await asyncio.sleep(_STOP_EVERY)
