"""The page's server among clients that are no browsers: half requests, odd messages."""

import asyncio
import socket
from collections.abc import Coroutine, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar
from urllib.error import HTTPError, URLError
from urllib.parse import urlsplit
from urllib.request import urlopen

import pytest
from tornado.websocket import websocket_connect

from observer_rt.config.bench import load_bench
from observer_rt.daemon.control_socket import control_socket, socket_places
from observer_rt.daemon.snapshot import SNAPSHOT
from tests.daemon.end_to_end import command
from tests.daemon.participants import bench_file, until
from tests.desk.live_page.browser import PageServer, served
from tests.desk.live_page.test_reading import said
from tests.desk.live_page.test_session import SHOWN

pytestmark = pytest.mark.slow


@contextmanager
def silent(folder: Path, *arguments: str) -> Iterator[PageServer]:
    bench = bench_file(folder, "served")
    with served(command("monitor", "--port", "0", "--bench", bench, *arguments), folder) as monitor:
        yield monitor


def answers(url: str) -> bool:
    try:
        with urlopen(url, timeout=5.0) as result:
            return bool(result.status == 200)
    except (URLError, OSError):
        return False


def said_until_end(monitor: PageServer) -> list[str]:
    monitor.process.terminate()
    assert monitor.process.stderr is not None
    return monitor.process.stderr.read().splitlines()


def test_a_request_that_never_ends_is_given_up(tmp_path: Path) -> None:
    with silent(tmp_path) as monitor:
        position = urlsplit(monitor.url)
        with socket.create_connection((position.hostname, position.port), timeout=20.0) as half:
            half.sendall(b"GET / HTTP/1.1\r\n")
            assert half.recv(1) == b""
        assert said_until_end(monitor) == []


async def closed_after(url: str, message: str) -> None:
    page = await websocket_connect(url)
    await page.write_message(message)
    while await page.read_message() is not None:
        pass


def test_odd_addresses_lead_nowhere_and_odd_messages_close_their_socket_and_say_nothing(tmp_path: Path) -> None:
    with silent(tmp_path) as monitor:
        for path in ("page.js%00.css", "%2e%2e/server.py", "%ff"):
            with pytest.raises(HTTPError, match="404"):
                urlopen(monitor.url + path)
        url = f"{monitor.url.replace('http', 'ws', 1)}drawings"
        for message in ("", "{", "[]", '["save"]', "[" * 900, '["save", null, 0]', "x" * 5000):
            run(closed_after(url, message))
        assert answers(monitor.url)
        assert said_until_end(monitor) == []


async def flood(url: str) -> None:
    page = await websocket_connect(url)
    for _ in range(20_000):
        await page.write_message('["save", 0, 1]')
    page.close()


def test_a_flood_of_saves_keeps_nobody_waiting_and_saves_once(tmp_path: Path) -> None:
    bench, kept = bench_file(tmp_path, "served"), tmp_path / "kept"
    file = socket_places(load_bench(bench).injector)[0]
    with control_socket(file, {SNAPSHOT: said(SHOWN)}), silent(tmp_path, "--out", str(kept)) as monitor:
        url = f"{monitor.url.replace('http', 'ws', 1)}drawings"
        with ThreadPoolExecutor(1) as thread:
            flooding = thread.submit(asyncio.run, flood(url))
            until(kept.exists)
            while not flooding.done():
                assert answers(monitor.url)
        assert answers(monitor.url)
        assert len(list(kept.glob("*.csv"))) == 1


T = TypeVar("T")


def run(coroutine: Coroutine[Any, Any, T]) -> T:
    """Its result. In a thread: Playwright's loop runs in the process's first one as long as the browser is open."""
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(asyncio.run, coroutine).result()
