"""The server of a page: Bokeh's, whose connections do not wait."""

import socket
from collections.abc import Callable
from ipaddress import ip_address

from bokeh.application import Application
from bokeh.application.handlers.function import FunctionHandler
from bokeh.document import Document
from bokeh.server.server import BaseServer
from bokeh.server.tornado import BokehTornado
from bokeh.server.util import create_hosts_allowlist
from bokeh.server.views.ws import WSHandler
from tornado.httpserver import HTTPServer
from tornado.ioloop import IOLoop
from tornado.netutil import bind_sockets


class PromptHandler(WSHandler):
    """Sends at once: else most drawings wait 40 ms for the receipt of the packet before."""

    def open(self) -> None:
        """A browser has connected."""
        self.set_nodelay(True)
        super().open()


def page_server(make_page: Callable[[Document], None], address: str, port: int) -> tuple[BaseServer, str]:
    """A server that is to be run, and its URL; port 0: one that is free. Raises OSError for a port that is taken."""
    sockets = bind_sockets(port, address)
    port = sockets[0].getsockname()[1]
    origins = create_hosts_allowlist(_origins(address, port), port)
    pages = BokehTornado({"/": Application(FunctionHandler(make_page))}, extra_websocket_origins=origins)
    route = {"application_context": pages.applications["/"], "bokeh_websocket_path": "/ws"}
    pages.add_handlers(".+", [("/ws", PromptHandler, route)])  # of any host: before Bokeh's own
    http = HTTPServer(pages)
    http.add_sockets(sockets)
    return BaseServer(IOLoop.current(), pages, http), f"http://{address}:{port}/"


def _origins(address: str, port: int) -> list[str]:
    """Names in the address bar under which a browser may talk to the server; any, where others are to reach it."""
    if ip_address(socket.gethostbyname(address)).is_loopback:
        return [f"{name}:{port}" for name in (address, "localhost", "127.0.0.1")]
    return ["*"]
