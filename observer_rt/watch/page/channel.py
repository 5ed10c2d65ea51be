"""The WebSocket of a page beside Bokeh's own, which takes five packets for a drawing and six for its receipt."""

from typing import Protocol
from urllib.parse import urlparse

from bokeh.server.util import check_allowlist
from tornado.ioloop import PeriodicCallback
from tornado.websocket import WebSocketHandler

from observer_rt.watch.page.drawing import Drawing

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
