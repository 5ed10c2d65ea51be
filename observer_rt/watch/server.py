"""`observer-rt monitor`: the page served until Ctrl-C."""

import gc
import socket
import sys
from ipaddress import ip_address
from pathlib import Path

from rich.console import Console

from observer_rt.config.bench import Bench
from observer_rt.foundation.errors import RunError, UserError
from observer_rt.terminal.console import say, stop_on_signals
from observer_rt.watch.watching import FrameSource, Watching

_STOP_EVERY = 100  # ms between two looks at the stop signal
_TURN = 0.0002  # s that the listening thread may go on while the page waits to be served


def serve_page(
    bench: Bench, source: FrameSource, address: str, port: int, folder: Path, console: Console
) -> None:
    """Listen to a source and serve its page until SIGINT or SIGTERM; port 0: one that is free; folder: of `Save`.

    Raises `UserError` without Bokeh or for a log that will not do, `RunError` for a port that is taken.
    """
    try:
        from bokeh.application import Application
        from bokeh.application.application import SessionContext
        from bokeh.application.handlers.function import FunctionHandler
        from bokeh.document import Document
        from bokeh.server.server import Server
        from tornado.ioloop import PeriodicCallback
    except ImportError as error:
        raise UserError(
            "monitor", "needs Bokeh, which is not installed", "pip install 'observer-rt[monitor]'"
        ) from error
    from observer_rt.watch.page.channel import PATH, Channel, Drawn
    from observer_rt.watch.page.document import Page

    watching = Watching(bench, source)
    pages: dict[str, Drawn] = {}

    def make_page(document: Document) -> None:
        page = Page(document, watching, folder)
        pages[page.token] = page

        def forget(_: SessionContext) -> None:
            del pages[page.token]

        document.on_session_destroyed(forget)

    application = Application(FunctionHandler(make_page))
    try:
        chosen = port or _free_port(address)
        origins = _origins(address, chosen)
        server = Server(
            {"/": application},
            address=address,
            port=chosen,
            allow_websocket_origin=origins,
            extra_patterns=[(PATH, Channel, {"pages": pages, "origins": origins})],
        )
    except OSError as error:
        raise RunError(
            f"--port {port}: {address} cannot be listened at ({error.strerror})\n"
            "  remedy: choose another port, or --port 0 for any that is free"
        ) from error
    with stop_on_signals() as stop:
        watching.start()
        say(console, f"http://{address}:{chosen}/ (Ctrl-C ends it)")

        def look() -> None:
            if stop.is_set():
                server.io_loop.stop()

        PeriodicCallback(look, _STOP_EVERY).start()
        sys.setswitchinterval(_TURN)
        gc.freeze()  # what is loaded stays: going through all of it now and then would hold up drawings
        try:
            server.run_until_shutdown()
        finally:
            watching.close()


def _free_port(address: str) -> int:
    with socket.create_server((address, 0)) as found:
        return int(found.getsockname()[1])


def _origins(address: str, port: int) -> list[str]:
    """Names in the address bar under which a browser may talk to the server; any, where others are to reach it."""
    if ip_address(socket.gethostbyname(address)).is_loopback:
        return [f"{name}:{port}" for name in (address, "localhost", "127.0.0.1")]
    return ["*"]
