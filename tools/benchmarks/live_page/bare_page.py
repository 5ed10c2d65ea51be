"""The least that Bokeh can do: a page with one line, drawn anew at a pace.

usage: python -m tools.benchmarks.live_page.bare_page PERIOD_MS
"""

import socket
import sys

import numpy as np
from bokeh.application import Application
from bokeh.application.handlers.function import FunctionHandler
from bokeh.document import Document
from bokeh.models import ColumnDataSource, Range1d
from bokeh.plotting import figure
from bokeh.server.server import Server

NAME = "line"
_POINTS = 300


def main(period_ms: int) -> None:
    """Serve it until SIGTERM."""
    shape = np.sin(np.linspace(0.0, np.pi, _POINTS))

    def make(document: Document) -> None:
        random = np.random.default_rng(1)
        source = ColumnDataSource({"x": np.arange(float(_POINTS)), "y": shape})
        drawn = figure(
            name=NAME, height=360, sizing_mode="stretch_width", y_range=Range1d(start=-1.0, end=2.0)
        )
        drawn.line("x", "y", source=source)
        document.add_root(drawn)

        def draw() -> None:
            source.data["y"] = shape + random.normal(0.0, 0.1, _POINTS)

        document.add_periodic_callback(draw, period_ms)

    with socket.create_server(("127.0.0.1", 0)) as found:
        port = found.getsockname()[1]
    place = f"127.0.0.1:{port}"
    application = Application(FunctionHandler(make))
    server = Server({"/": application}, port=port, address="127.0.0.1", allow_websocket_origin=[place])
    print(f"http://{place}/", file=sys.stderr, flush=True)
    server.run_until_shutdown()


if __name__ == "__main__":
    main(int(sys.argv[1]))
