"""The view on a terminal, beside the loops."""

import threading
import time
from typing import Protocol

from rich.console import Console, RenderableType
from rich.live import Live

FRAMES_PER_SECOND = 8


class Screen(Protocol):
    """What can be drawn."""

    def render(self, now: int, width: int, height: int) -> RenderableType:
        """At a monotonic time [ns], for a terminal of `width` x `height` characters."""


def draw(screen: Screen, until: threading.Event, console: Console) -> None:
    """Draw the view on a terminal until the event is set."""

    def picture() -> RenderableType:
        return screen.render(time.monotonic_ns(), console.width, console.height)

    with Live(picture(), console=console, auto_refresh=False) as live:
        while not until.wait(1 / FRAMES_PER_SECOND):
            live.update(picture(), refresh=True)
        live.update(picture(), refresh=True)
