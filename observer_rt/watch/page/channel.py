"""The WebSocket of a page beside Bokeh's own: all that a browser is to draw, one message at a time."""

import json
from collections.abc import Callable, Mapping
from typing import Any, Protocol, TypeAlias
from urllib.parse import urlparse

import numpy as np
from bokeh.server.util import check_allowlist
from tornado.ioloop import PeriodicCallback
from tornado.websocket import WebSocketHandler

from observer_rt.watch.page.panel import PanelPart

Parts: TypeAlias = Mapping[str, str | PanelPart]
"""By name: what stands in an element of the page, as HTML, or what a panel shows."""
_AHEAD = 2  # messages: one is on its way while the last one is drawn
_BYTES = 4  # of a number


class Drawing:
    """Brings parts to a browser."""

    def __init__(self) -> None:
        self._number = 0
        self._send: Callable[[bytes], None] | None = None
        self.drawn = 0
        """Number of the last message that the browser has drawn."""

    def connect(self, send: Callable[[bytes], None]) -> None:
        """Send to this browser from now on."""
        self._send = send
        self._number = self.drawn = 0

    @property
    def is_behind(self) -> bool:
        """Whether the browser is not ready for more."""
        return self._send is None or self._number - self.drawn >= _AHEAD

    def send(self, parts: Parts) -> None:
        """Draw these; what is in none of them stays."""
        assert self._send is not None
        self._number += 1
        self._send(packed(self._number, parts))


def packed(number: int, parts: Parts) -> bytes:
    """A message: the length of the text, the text as JSON, then the values of all columns as float32.

    What is little-endian here is so in browsers.
    """
    said: dict[str, Any] = {}
    values: list[bytes] = []
    start = 0
    for name, part in parts.items():
        if isinstance(part, str):
            said[name] = part
            continue
        lengths = {column: each.size for column, each in part.columns.items()}
        said[name] = {"x": part.x, "y": part.y, "lengths": lengths, "start": start}
        values += (each.astype("<f4").tobytes() for each in part.columns.values())
        start += sum(lengths.values())
    text = json.dumps({"number": number, "parts": said}).encode()
    text += b" " * (-len(text) % _BYTES)  # values stand at multiples of their width
    return b"".join([np.uint32(len(text)).astype("<u4").tobytes(), text, *values])


PATH = "/drawings"
_LOOK_EVERY = 10  # ms: whether something is new and the browser through with the last drawing


class Drawn(Protocol):
    """A page that is drawn."""

    @property
    def drawing(self) -> Drawing:
        """How its parts come to the browser."""

    def begin(self) -> None:
        """A browser has connected, that shows nothing yet."""

    def draw(self) -> None:
        """Send what is new."""


class Channel(WebSocketHandler):
    """Brings a page's drawings to its browser, which answers each with its number once it is drawn."""

    def initialize(self, pages: dict[str, Drawn], origins: list[str]) -> None:
        """pages: by their tokens; origins: names of this server under which it may be talked to."""
        self._pages = pages
        self._origins = origins
        self._looking: PeriodicCallback | None = None  # while a page is drawn

    def check_origin(self, origin: str) -> bool:
        """Whether a page from there may listen."""
        return bool(check_allowlist(urlparse(origin).netloc.lower(), self._origins))

    def open(self) -> None:
        """The browser has the page."""
        page = self._pages.get(self.get_argument("page"))
        if page is None:
            self.close()
            return
        self._page = page
        self.set_nodelay(True)  # else most drawings wait 40 ms for the receipt of the packet before
        page.drawing.connect(self._send)
        page.begin()
        self._looking = PeriodicCallback(page.draw, _LOOK_EVERY)
        self._looking.start()

    def on_message(self, message: str | bytes) -> None:
        """The browser has drawn."""
        self._page.drawing.drawn = int(message)
        self._page.draw()

    def on_close(self) -> None:
        """The browser is gone."""
        if self._looking is not None:
            self._looking.stop()

    def _send(self, message: bytes) -> None:
        self.write_message(message, binary=True)
