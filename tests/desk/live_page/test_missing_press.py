"""Buttons of the page of the missing effect, pressed over HTTP."""

import asyncio
import os
import shutil
from pathlib import Path
from urllib.parse import urlencode

import pytest
from tornado.httpclient import AsyncHTTPClient, HTTPResponse
from tornado.httpserver import HTTPServer
from tornado.netutil import bind_sockets
from tornado.web import Application, RequestHandler

from observer_rt.config.bench import EXAMPLE_BENCH, load_bench
from observer_rt.config.injector import EvidenceConfig
from observer_rt.desk.live_page.missing.handlers import MissingEffects, handlers_of
from observer_rt.desk.live_page.missing.word import SecretWord
from observer_rt.desk.live_page.reading import Watching
from tests.desk.live_page import event_loop

QUESTION = "observer_rt.desk.live_page.missing.search.question"


class Buttons:
    """The page's addresses in this process, and who presses."""

    def __init__(self, folder: Path) -> None:
        path = shutil.copyfile(EXAMPLE_BENCH, folder / "bench.toml")
        (folder / "evidence" / "missing").mkdir(parents=True)
        bench = load_bench(path).with_sections(evidence=EvidenceConfig(folder="evidence"))
        watching = Watching(bench)
        watching.close()
        self._word = SecretWord(lambda _: None)
        missing = MissingEffects(bench, watching, self._word, lambda: bench)
        (socket,) = bind_sockets(0, "127.0.0.1")
        self._host = f"127.0.0.1:{socket.getsockname()[1]}"
        HTTPServer(Application(handlers_of(RequestHandler, missing))).add_socket(socket)

    async def press(self, origin: str = "http://{host}") -> HTTPResponse:
        """Press the button of the search, on a page of some server."""
        asked = urlencode({"button": "search", "injector": "", "word": self._word.text})
        return await AsyncHTTPClient().fetch(
            f"http://{self._host}/missing/press",
            method="POST",
            body=asked,
            headers={"Origin": origin.format(host=self._host)},
            raise_error=False,
        )


def test_a_second_press_of_the_search_is_refused_in_words(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gate = tmp_path / "gate"
    os.mkfifo(gate)
    monkeypatch.setattr(QUESTION, lambda *_: ["cat", str(gate)])  # a search that ends when the gate is opened

    async def press_twice() -> list[tuple[int, str]]:
        buttons = Buttons(tmp_path)
        answers = [await buttons.press(), await buttons.press()]
        (await asyncio.to_thread(gate.open, "w")).close()
        return [(answer.code, answer.body.decode()) for answer in answers]

    (first, _), (second, said) = event_loop.run(press_twice())
    assert (first, second) == (200, 409)
    assert "is on its way" in said


def test_a_page_of_another_server_presses_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[object] = []
    monkeypatch.setattr(QUESTION, lambda *arguments: asked.append(arguments))
    answer = event_loop.run(pressed_from(tmp_path, "http://elsewhere.example"))
    assert (answer.code, asked) == (403, [])
    assert "another server" in answer.body.decode()


async def pressed_from(folder: Path, origin: str) -> HTTPResponse:
    return await Buttons(folder).press(origin)
