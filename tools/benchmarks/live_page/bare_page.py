"""The least that uPlot and a WebSocket can do: a page with one line, drawn anew at a pace.

usage: python -m tools.benchmarks.live_page.bare_page PERIOD_MS
"""

import asyncio
import sys
from pathlib import Path

import numpy as np
from tornado.httpserver import HTTPServer
from tornado.netutil import bind_sockets
from tornado.web import Application, RequestHandler, StaticFileHandler
from tornado.websocket import WebSocketHandler

import observer_rt.desk.live_page.page

NAME = "line"
_POINTS = 300
_UPLOT = Path(observer_rt.desk.live_page.page.__file__).parent / "static" / "uplot"
_PAGE = f"""<!doctype html>
<link rel="icon" href="data:,">
<link rel="stylesheet" href="uPlot.min.css">
<div id="{NAME}"></div>
<script src="uPlot.iife.min.js"></script>
<script>
  const x = Array.from({{ length: {_POINTS} }}, (_, k) => k);
  const options = {{ width: innerWidth - 20, height: 360, scales: {{ x: {{ time: false }}, y: {{ range: [-1, 2] }} }},
    series: [{{}}, {{ stroke: "blue", points: {{ show: false }} }}] }};
  const plot = new uPlot(options, [x, x], document.getElementById("{NAME}"));
  const socket = new WebSocket(`ws://${{location.host}}/line`);
  socket.binaryType = "arraybuffer";
  socket.onmessage = ({{ data }}) => plot.setData([x, new Float32Array(data)]);
</script>
"""


class _Page(RequestHandler):
    def get(self) -> None:
        self.write(_PAGE)


class _Line(WebSocketHandler):
    def initialize(self, period: float) -> None:
        self._period = period

    async def open(self) -> None:
        self.set_nodelay(True)
        shape, random = np.sin(np.linspace(0.0, np.pi, _POINTS)), np.random.default_rng(1)
        while self.ws_connection is not None:
            values = shape + random.normal(0.0, 0.1, _POINTS)
            self.write_message(values.astype("<f4").tobytes(), binary=True)
            await asyncio.sleep(self._period)


async def main(period_ms: int) -> None:
    """Serve it until SIGTERM."""
    sockets = bind_sockets(0, "127.0.0.1")
    application = Application(
        [
            ("/", _Page),
            ("/line", _Line, {"period": 1e-3 * period_ms}),
            ("/(.*)", StaticFileHandler, {"path": _UPLOT}),
        ]
    )
    HTTPServer(application).add_sockets(sockets)
    print(f"http://127.0.0.1:{sockets[0].getsockname()[1]}/", file=sys.stderr, flush=True)
    await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(main(int(sys.argv[1])))
