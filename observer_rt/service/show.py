"""The view on a terminal, beside the daemon's loop."""

import threading
import time

from rich.console import Console, RenderableType
from rich.live import Live

from observer_rt.service.daemon import Daemon
from observer_rt.service.view import View

FRAMES_PER_SECOND = 8


def run_with_view(daemon: Daemon, screen: View, stop: threading.Event, console: Console) -> None:
    """The loop in a thread of its own, the view in this one; an error of the loop is raised here."""
    failure: list[BaseException] = []

    def loop() -> None:
        try:
            daemon.run(stop)
        except BaseException as error:
            failure.append(error)
            stop.set()

    serving = threading.Thread(target=loop, name="daemon")
    serving.start()
    try:
        draw(screen, stop, console)
    finally:
        stop.set()
        serving.join()
    if failure:
        raise failure[0]


def draw(screen: View, until: threading.Event, console: Console) -> None:
    """Draw the view on a terminal until the event is set."""

    def picture() -> RenderableType:
        return screen.render(time.monotonic_ns(), console.width, console.height)

    with Live(picture(), console=console, auto_refresh=False) as live:
        while not until.wait(1 / FRAMES_PER_SECOND):
            live.update(picture(), refresh=True)
        live.update(picture(), refresh=True)
