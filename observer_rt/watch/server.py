"""`observer-rt monitor`: the page served until Ctrl-C."""

import gc
import socket
import sys
from dataclasses import dataclass
from ipaddress import ip_address
from pathlib import Path

from rich.console import Console

from observer_rt.config.bench import Bench
from observer_rt.foundation.errors import RunError, UserError
from observer_rt.terminal.console import say
from observer_rt.terminal.stop import stop_on_signals
from observer_rt.watch.listening import LiveSource, LogSource
from observer_rt.watch.watching import Source, Watching

_STOP_EVERY = 100  # ms between two looks at the stop signal
_TURN = 0.0002  # s that the listening thread may go on while the page waits to be served


@dataclass(frozen=True)
class MonitorOptions:
    """What the command line says: a log instead of the buses, where the page is served, where injections are saved.

    speed: of a log; port 0: one that is free.
    """

    log: Path | None = None
    from_channels: tuple[str, ...] = ()
    speed: float = 1.0
    address: str = "127.0.0.1"
    port: int = 5006
    folder: Path = Path()


def monitor(bench: Bench, options: MonitorOptions, console: Console) -> None:
    """Listen and serve the page until SIGINT or SIGTERM.

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

    watching = Watching(bench, _source(bench, options))
    pages: dict[str, Drawn] = {}

    def make_page(document: Document) -> None:
        page = Page(document, watching, options.folder)
        pages[page.token] = page

        def forget(_: SessionContext) -> None:
            del pages[page.token]

        document.on_session_destroyed(forget)

    application = Application(FunctionHandler(make_page))
    try:
        port = options.port or _free_port(options.address)
        origins = _origins(options.address, port)
        server = Server(
            {"/": application},
            address=options.address,
            port=port,
            allow_websocket_origin=origins,
            extra_patterns=[(PATH, Channel, {"pages": pages, "origins": origins})],
        )
    except OSError as error:
        raise RunError(
            f"--port {options.port}: {options.address} cannot be listened at ({error.strerror})\n"
            "  remedy: choose another port, or --port 0 for any that is free"
        ) from error
    with stop_on_signals() as stop:
        watching.start()
        say(console, f"http://{options.address}:{port}/ (Ctrl-C ends it)")

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


def _source(bench: Bench, options: MonitorOptions) -> Source:
    if options.log is None:
        return LiveSource(bench)
    return LogSource(options.log, bench.config.buses, options.from_channels, options.speed)
