"""`observer-rt monitor`: the page served until Ctrl-C, and a WebSocket, as fast as it draws, for each browser."""

import asyncio
import gc
import hmac
import json
import re
import secrets
import socket
import time
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict, replace
from ipaddress import ip_address
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from tornado.httpserver import HTTPServer
from tornado.ioloop import PeriodicCallback
from tornado.netutil import bind_sockets
from tornado.web import Application, RequestHandler, StaticFileHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from observer_rt.config.bench import Bench
from observer_rt.daemon.snapshot import ShownInjection
from observer_rt.desk.live_page.reading import Watching
from observer_rt.foundation.console import say
from observer_rt.foundation.errors import ObserverError, RunError, file_errors
from observer_rt.foundation.files import replacing, write_text
from observer_rt.foundation.stop_request import stop_on_signals

MOST_SAVED = 1000  # injections, for whoever reaches the page may ask for it
_AHEAD = 2  # messages: one is on its way while the last one is drawn
_STATUS_EVERY = 0.4  # s
_WITH_CURVES = 8  # injections of a message, the newest: what a browser draws
_VALUES = (
    *("number", "valid", "verdict", "remainder", "mass_mg", "mass_bound_mg"),
    *("rail_pressure_MPa", "density_kg_per_m3"),
    *(f"{name}{end}" for name in ("nozzle_v_H", "seat_v_S") for end in ("", "_ci95_low", "_ci95_high")),
)
_FILES = Path(__file__).parent / "static"
_COOKIE = "observer_rt"
_ALIVE_EVERY = 0.5  # s after which a browser gets at least an empty message
_LOOK_EVERY = 10  # ms: whether something is new and a browser through with the last drawing
_TIMEOUT = 5.0  # s for the headers of a request, and until the next one
_LONGEST = 1000  # bytes of what a browser says
_STOP_EVERY = 0.1  # s between two looks at the stop signal


class Saver:
    """Saves injections in a folder for all browsers: one at a time, beside the page's loop, and each once."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._saved: dict[tuple[str, int], Path] = {}
        self._thread = ThreadPoolExecutor(1, "saving")

    def save(self, injection: ShownInjection, name: str) -> Future[str]:
        """Save an injection later; the result is its place, or the reason of a failure. name: of the injector."""
        return self._thread.submit(self._save, injection, name)

    def close(self) -> None:
        """Save no more."""
        self._thread.shutdown(cancel_futures=True)

    def _save(self, injection: ShownInjection, name: str) -> str:
        path = self._saved.get((name, injection.count))
        try:
            with file_errors(self._folder):
                if path is None or not path.exists():
                    if len(self._saved) >= MOST_SAVED:
                        return f"not saved: {MOST_SAVED} injections are already; start `observer-rt monitor` anew"
                    path = self._saved[name, injection.count] = save_injection(injection, self._folder, name)
        except ObserverError as error:
            return str(error)
        return f"saved: {path}, .json"


def save_injection(shown: ShownInjection, folder: Path, name: str) -> Path:
    """Write the new `injection_[NAME_]NUMBER[_AGAIN].csv`, returned, and `.json`. Raises `ObserverError`."""
    stem = f"injection_{f'{name}_' if name else ''}{shown.values['number']}"
    path, again = folder / f"{stem}.csv", 1
    while path.exists() or path.with_suffix(".json").exists():  # numbers begin anew with each daemon
        again += 1
        path = folder / f"{stem}_{again}.csv"
    masses = {f"{reference}_mass_mg": mass for reference, mass in shown.references.items()}
    document = {**shown.values, **masses, "moment_ns": shown.moment}
    columns = np.column_stack([*shown.curves.values()]) if shown.curves else np.empty((0, 0))
    with file_errors(path):
        folder.mkdir(parents=True, exist_ok=True)
        with replacing(path) as part:
            np.savetxt(part, columns, "%.7g", ",", header=",".join(shown.curves), comments="")
    write_text(path.with_suffix(".json"), json.dumps(document, indent=2, allow_nan=False))
    return path


def read_button(message: str | bytes) -> tuple[str, int, int] | None:
    """Read a browser's message: a button and its values; None for a message that no page of ours sends."""
    try:
        parsed = json.loads(message)
    except (ValueError, RecursionError):
        return None
    match parsed:
        case [str(button), int(number), int(count)]:
            return button, number, count
    return None


class Session:
    """Sends updates to one browser."""

    def __init__(self, watching: Watching, saver: Saver) -> None:
        self._watching = watching
        self._saver = saver
        self._saving: Future[str] | None = None
        self._answer: dict[str, Any] = {"names": [reader.name for reader in watching.readers]}
        self._asked: dict[tuple[int, int], ShownInjection] = {}  # by injector and count
        self._sent = [0] * len(watching.readers)  # injections
        self._number = self._drawn = 0  # of messages: the last one sent, the last one drawn
        self._due = 0.0  # s

    def take_drawn(self, number: int) -> None:
        """The browser has drawn a message."""
        self._drawn = min(max(number, self._drawn), self._number)

    def take(self, button: str, injector: int, count: int) -> None:
        """A button was pressed. count: of an injection."""
        if injector not in range(len(self._sent)):
            return
        reader = self._watching.readers[injector]
        injection = next((injection for injection in reader.injections(count - 1) if injection.count == count), None)
        self._due = 0.0  # who presses a button waits for nothing
        if button == "save" and injection is None:
            self._answer["notice"] = "there is no injection yet"
        elif button == "save" and injection is not None:
            self._saving = self._saving or self._saver.save(injection, reader.name)
        elif button == "curves" and injection is not None and count <= self._sent[injector]:
            self._asked[injector, count] = injection

    def message(self) -> bytes | None:
        """Changes since the last message; None without changes, or while the browser still draws earlier ones."""
        readers, now = self._watching.readers, time.monotonic()
        if self._saving is not None and self._saving.done():
            self._answer["notice"], self._saving, self._due = self._saving.result(), None, 0.0
        has_news = any(reader.count > sent for reader, sent in zip(readers, self._sent, strict=True))
        if self._number - self._drawn >= _AHEAD or not (has_news or now >= self._due):
            return None
        self._due = now + _STATUS_EVERY
        self._number += 1
        injectors: list[dict[str, Any]] = []
        curves: list[bytes] = []
        for number, reader in enumerate(readers):
            seen, news = reader.seen(), reader.injections(self._sent[number])
            self._sent[number] = news[-1].count if news else self._sent[number]
            asked = [injection for (owner, _), injection in self._asked.items() if owner == number]
            without_curves = (replace(injection, curves={}) for injection in news[:-_WITH_CURVES])
            sent = [*asked, *without_curves, *news[-_WITH_CURVES:]]
            injectors.append({**asdict(seen), "news": [_shown(injection) for injection in sent]})
            curves += [injection.data for injection in sent]
        content = {
            "number": self._number,
            "now": time.time_ns(),
            "buses": [asdict(bus) for bus in self._watching.buses()],
            "injectors": injectors,
            **self._answer,
        }
        self._answer, self._asked = {}, {}
        return pack_message(content, curves)


def _shown(injection: ShownInjection) -> dict[str, Any]:
    values = {name: injection.values.get(name) for name in _VALUES}
    return {**injection.text, "values": values, "nominal": injection.references.get("nominal")}


def pack_message(content: dict[str, Any], curves: Sequence[bytes]) -> bytes:
    """A message: the length of the text, the text as JSON, the values of all curves as float32, little-endian."""
    text = json.dumps(content, allow_nan=False).encode()
    text += b" " * (-len(text) % 4)  # values stand at multiples of their width
    return b"".join([len(text).to_bytes(4, "little"), text, *curves])


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
    """Serve the page of a bench until SIGINT or SIGTERM; port 0 is a free one. Raises `RunError` for a taken port."""
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
