"""The live page beside a daemon on a real SocketCAN interface: what its browsers are told, over its own WebSocket."""

import json
import subprocess
from collections.abc import Generator, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from tornado.ioloop import IOLoop
from tornado.websocket import websocket_connect

from observer_rt.files.formats import write_recording
from tests.daemon.end_to_end import START_TIMEOUT, command
from tests.daemon.participants import bench_file, until
from tests.desk.live_page.browser import served
from tests.desk.live_page.message import unpacked
from tests.device import worn_recording

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


@dataclass
class Shown:
    """What stands in a browser: letters of the injector by their element, columns by panel and name."""

    letters: Mapping[str, str]
    columns: Mapping[str, Mapping[str, NDArray[np.float32]]]

    @property
    def banner(self) -> str:
        """State and faults."""
        return self.letters.get("banner_0", "")

    def highest(self, panel: str, name: str) -> float:
        """Of a curve; 0 as long as nothing is drawn."""
        return float(np.nan_to_num(self.columns.get(panel, {}).get(name, ())).max(initial=0.0))


def opened(url: str) -> Generator[Shown, None, None]:
    """The page after each message to a browser: there is one a second at least, for the clock goes on."""
    loop = IOLoop(make_current=False)
    socket = loop.run_sync(lambda: websocket_connect(f"{url.replace('http', 'ws', 1)}drawings"))
    shown = Shown({}, {})
    try:
        while True:
            message = loop.run_sync(socket.read_message)
            assert isinstance(message, bytes)
            if not message:  # there is nothing new
                continue
            said, columns = unpacked(message)
            shown = Shown({**shown.letters, **said.get("letters", {})}, {**shown.columns, **columns})
            drawn = json.dumps(["drawn", said["number"]])
            loop.run_sync(lambda drawn=drawn: socket.write_message(drawn))
            yield shown
    finally:
        socket.close()
        loop.close(all_fds=True)


@pytest.mark.slow
@pytest.mark.vcan
def test_a_page_beside_a_daemon(bench: Path, tmp_path: Path) -> None:
    write_recording(tmp_path / "worn.csv", worn_recording(INJECTIONS))
    replay = command("replay", tmp_path / "worn.csv", "--bench", bench, "--speed", SPEED)
    with (
        served(command("monitor", "--port", "0", "--bench", bench)) as page,
        closing(opened(page.url)) as browser,
    ):
        with daemon_of(bench):
            subprocess.run(replay, check=True, timeout=START_TIMEOUT)
            until(lambda: f"<td>{INJECTIONS} " in next(browser).letters.get("numbers_0", ""))
            until(lambda: next(browser).highest("rate_0", "rate") > 20.0)
            until(lambda: next(browser).highest("needle_lift", "needle_lift") > 100.0)
            until(lambda: len(next(browser).columns.get("mass", {}).get("valid", ())) == INJECTIONS)
            until(lambda: "SampleBlock 0x100" in next(browser).banner)  # which the replay sends no more
            assert "ObserverStatus" not in next(browser).banner
        until(lambda: "start `observer-rt run`" in next(browser).banner)
        assert page.process.poll() is None
