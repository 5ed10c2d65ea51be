"""The live page beside a daemon on a real SocketCAN interface: what its browsers are told, over its own WebSocket."""

import re
import subprocess
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from urllib.request import urlopen

import numpy as np
import pytest
from numpy.typing import NDArray
from tornado.ioloop import IOLoop
from tornado.websocket import websocket_connect

from observer_rt.recording.formats import write_recording
from tests.device import worn_recording
from tests.service.end_to_end import START_TIMEOUT, command
from tests.service.participants import bench_file, until
from tests.watch.message import unpacked
from tools.benchmarks.live_page.browser import served

INJECTIONS = 4
SPEED = "0.1"


@pytest.fixture
def bench(tmp_path: Path, vcan: str) -> Path:
    return bench_file(tmp_path, vcan, "socketcan")


@contextmanager
def daemon_of(bench: Path) -> Iterator[None]:
    """A daemon that is ready; ended at the end."""
    words = command("run", "--bench", bench)
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True) as daemon:
        try:
            assert daemon.stderr is not None
            assert any("ready" in line for line in daemon.stderr)
            yield
        finally:
            daemon.terminate()


class Opened:
    """The page as a browser gets it: reads what it is to draw, a message at a look, and says that it has drawn it."""

    def __init__(self, url: str) -> None:
        with urlopen(url) as page:
            found = re.search('data-token="([^"]+)"', page.read().decode())
        assert found is not None
        self._loop = IOLoop(make_current=False)
        address = f"{url.replace('http', 'ws', 1)}drawings?page={found[1]}"
        self._socket = self._loop.run_sync(lambda: websocket_connect(address))
        self._letters: dict[str, str] = {}
        self._columns: dict[str, dict[str, NDArray[np.float32]]] = {}

    def banner(self) -> str:
        """The letters of the injector."""
        self._look()
        return self._letters.get("banner_0", "")

    def column(self, panel: str, name: str) -> NDArray[np.float32]:
        """What a panel is to draw, none as long as nothing has come for it."""
        self._look()
        return self._columns.get(panel, {}).get(name, np.empty(0, np.float32))

    def close(self) -> None:
        self._socket.close()
        self._loop.close(all_fds=True)

    def _look(self) -> None:
        """At the next message: there is one a second at least, for the clock goes on."""
        message = self._loop.run_sync(self._socket.read_message)
        assert isinstance(message, bytes)
        number, letters, columns = unpacked(message)
        self._letters |= letters
        self._columns |= columns
        self._loop.run_sync(lambda: self._socket.write_message(str(number)))


@pytest.mark.slow
@pytest.mark.vcan
def test_a_page_beside_a_daemon(bench: Path, tmp_path: Path) -> None:
    write_recording(tmp_path / "worn.csv", worn_recording(INJECTIONS))
    replay = command("replay", tmp_path / "worn.csv", "--bench", bench, "--speed", SPEED)
    with (
        served(command("monitor", "--port", "0", "--bench", bench)) as page,
        closing(Opened(page.url)) as browser,
    ):
        with daemon_of(bench):
            subprocess.run(replay, check=True, timeout=START_TIMEOUT)
            until(lambda: f"<td>{INJECTIONS} " in browser.banner())
            until(lambda: bool(np.nanmax(browser.column("rate_0", "rate"), initial=0.0) > 20.0))
            until(lambda: bool(np.nanmax(browser.column("needle_lift", "needle_lift"), initial=0.0) > 100.0))
            until(lambda: browser.column("mass", "valid").size == INJECTIONS)
            until(lambda: "SampleBlock 0x100" in browser.banner())  # which the replay sends no more
            assert "ObserverStatus" not in browser.banner()
        until(lambda: "ObserverStatus" in browser.banner() and "observer-rt run" in browser.banner())
        assert page.process.poll() is None
