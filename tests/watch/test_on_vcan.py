"""The live page beside a daemon on a real SocketCAN interface: what its browsers are told, over its own WebSocket."""

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from bokeh.client import pull_session
from bokeh.document import Document

from observer_rt.recording.formats import write_recording
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


@contextmanager
def opened(url: str) -> Iterator[Document]:
    """The page as a browser has it."""
    session = pull_session(url=url)
    try:
        yield session.document
    finally:
        session.close()


def banner(document: Document) -> str:
    return str(document.get_model_by_name("banner_0").text)


@pytest.mark.slow
@pytest.mark.vcan
def test_a_page_beside_a_daemon(bench: Path, tmp_path: Path) -> None:
    write_recording(tmp_path / "worn.csv", worn_recording(INJECTIONS))
    replay = command("replay", tmp_path / "worn.csv", "--bench", bench, "--speed", SPEED)
    with (
        served(command("monitor", "--port", "0", "--bench", bench)) as page,
        opened(page.url) as document,
    ):
        with daemon_of(bench):
            subprocess.run(replay, check=True, timeout=START_TIMEOUT)
            until(lambda: f"<td>{INJECTIONS} " in banner(document))
            assert "class='state good'" in banner(document)
            assert "class='fault'" not in banner(document)
            rate = document.get_model_by_name("rate_0").select_one({"name": "rate"})
            assert rate.data_source.data["rate"].max() > 20.0
        until(lambda: "ObserverStatus" in banner(document) and "observer-rt run" in banner(document))
        assert page.process.poll() is None
