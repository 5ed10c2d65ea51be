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
    """The page as a browser gets it; one that never draws, and so is told of all anew every second."""

    def __init__(self, url: str) -> None:
        self._url = url
        self._session = pull_session(url=url)  # which lasts as long as somebody listens to it

    def parts(self) -> dict[str, Any]:
        """What is to be drawn now."""
        with closing(pull_session(session_id=self._session.id, url=self._url)) as looking:
            message = looking.document.select_one({"type": Message})
        assert isinstance(message, Message)
        content: Any = message.content
        return dict(content["parts"])

    def banner(self) -> str:
        return str(self.parts().get("banner_0", ""))

    def close(self) -> None:
        self._session.close()


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
            parts = browser.parts()
            assert np.nanmax(parts["rate_0_shown"]["rate"]) > 20.0
            assert np.nanmax(parts["details_shown"]["needle_lift"]) > 100.0
            assert parts["history"]["mass"].size == INJECTIONS
            until(lambda: "SampleBlock 0x100" in browser.banner())  # which the replay sends no more
            assert "ObserverStatus" not in browser.banner()
        until(lambda: "ObserverStatus" in browser.banner() and "observer-rt run" in browser.banner())
        assert page.process.poll() is None
