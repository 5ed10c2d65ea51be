"""The live page beside a daemon on a real SocketCAN interface: what its browsers are told, over its own WebSocket."""

import subprocess
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bokeh.client import pull_session

from observer_rt.recording.formats import write_recording
from observer_rt.watch.page.drawing import Message
from tests.service.end_to_end import START_TIMEOUT, command
from tests.service.participants import bench_file, until, worn_recording
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
    """The page as a browser gets it, which looks at it whenever it is asked, and says of the message before that it is drawn."""

    def __init__(self, url: str) -> None:
        self._url = url
        self._session = pull_session(url=url)  # which lasts as long as somebody listens to it
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
        self._session.close()

    def _look(self) -> None:
        with closing(pull_session(session_id=self._session.id, url=self._url)) as looking:
            message = looking.document.select_one({"type": Message})
            assert isinstance(message, Message)
            content: Any = message.content
            message.drawn = content["number"] - 1
        for name, part in content["parts"].items():
            if isinstance(part, str):
                self._letters[name] = part
                continue
            ends = part["start"] + np.cumsum([0, *part["lengths"].values()])
            stretches = zip(part["lengths"], ends[:-1], ends[1:], strict=True)
            self._columns[name] = {column: content["values"][a:b] for column, a, b in stretches}


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
            until(lambda: np.nanmax(browser.column("rate_0", "rate"), initial=0.0) > 20.0)
            until(lambda: np.nanmax(browser.column("needle_lift", "needle_lift"), initial=0.0) > 100.0)
            until(lambda: browser.column("mass", "valid").size == INJECTIONS)
            until(lambda: "SampleBlock 0x100" in browser.banner())  # which the replay sends no more
            assert "ObserverStatus" not in browser.banner()
        until(lambda: "ObserverStatus" in browser.banner() and "observer-rt run" in browser.banner())
        assert page.process.poll() is None
