"""What a browser is sent: not more than it can draw, whatever it says; and the files that it saves."""

import json
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from observer_rt.config.bench import load_bench
from observer_rt.daemon.snapshot import ShownInjection
from observer_rt.desk.live_page.reading import Watching
from observer_rt.desk.live_page.server import Saver, Session, read_button, save_injection
from tests.daemon.participants import bench_file, until
from tests.desk.live_page.test_reading import said
from tests.desk.live_page.test_reading import watching as watching_at

SHOWN = ShownInjection(1, 5, {"number": 7, "mass_mg": None}, {"nominal": None})


@pytest.fixture(scope="module")
def watching() -> Iterator[Watching]:
    view = Watching(load_bench())
    yield view
    view.close()


_JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.sampled_from(["drawn", "save", "curves", "?"]),
    lambda inner: st.lists(inner, max_size=3),
)


@given(st.text() | st.binary() | _JSON.map(json.dumps))
@example("[" * 100_000)
@example('["curves", 7, 0]')
@example('["save", 0, -1]')
@example('["drawn", 1e999, 0]')
@example('["drawn", -2, 0]')
def test_whatever_is_said_is_a_button_or_nothing(watching: Watching, message: str | bytes) -> None:
    """And a button that there is not does no harm."""
    if (result := read_button(message)) is not None:
        session = Session(watching, Saver(Path()))
        session.take(*result)
        assert session.message() is not None


def text_of(message: bytes) -> Any:
    return json.loads(message[4 : 4 + int.from_bytes(message[:4], "little")])


def sent_until_behind(session: Session) -> list[bytes]:
    sent = []
    while (message := session.message()) is not None:
        sent.append(message)
        session.take("save", 0, 0)
    return sent


def test_a_browser_that_does_not_answer_or_claims_to_be_ahead_is_sent_no_more(watching: Watching) -> None:
    session = Session(watching, Saver(Path()))
    session.take_drawn(10**9)
    for _ in range(3):
        sent = sent_until_behind(session)
        assert len(sent) in (1, 2, 3)
        content = text_of(sent[-1])
        session.take_drawn(content["number"])
    assert content["notice"] == "there is no injection yet"
    assert session.message() is not None
    assert session.message() is None  # nothing new


def test_a_saved_injection_is_a_recording_by_a_name_that_is_free(tmp_path: Path) -> None:
    (tmp_path / "injection_left_7.csv").write_text("mine")
    (tmp_path / "injection_left_7_2.json").write_text("mine")
    path = save_injection(SHOWN, tmp_path, "left")
    assert path == tmp_path / "injection_left_7_3.csv"
    curves = {name: np.array([0.01], np.float32) for name in ("time_ms", "line_pressure_MPa")}
    path = save_injection(ShownInjection(1, 5, SHOWN.values, SHOWN.references, curves), tmp_path, "left")
    assert path.read_text() == "time_ms,line_pressure_MPa\n0.01,0.01\n"  # not 9.99999978e-03
    said = json.loads(path.with_suffix(".json").read_text())
    assert said == {"number": 7, "mass_mg": None, "nominal_mass_mg": None, "moment_ns": 5}
    assert (tmp_path / "injection_left_7.csv").read_text() == "mine"


def test_of_many_new_injections_the_newest_come_with_their_curves(tmp_path: Path) -> None:
    many = [ShownInjection(count, 5, {}, {}, {"time_ms": np.zeros(1, np.float32)}) for count in range(1, 13)]
    with watching_at(bench_file(tmp_path, "many"), {"": said(*many)}) as view:
        until(lambda: view.readers[0].count == len(many))
        message = Session(view, Saver(tmp_path)).message() or b""
    news = [(one["count"], one["curves"]) for one in text_of(message)["injectors"][0]["news"]]
    assert news == [*((count, []) for count in range(1, 5)), *((count, ["time_ms"]) for count in range(5, 13))]


class SlowSaver(Saver):
    def __init__(self) -> None:
        self.results: list[Future[str]] = []

    def save(self, injection: ShownInjection, name: str) -> Future[str]:
        self.results.append(Future())
        return self.results[-1]


def test_a_browser_saves_one_at_a_time_and_hears_of_it_once_it_is_done(tmp_path: Path) -> None:
    saver = SlowSaver()
    with watching_at(bench_file(tmp_path, "saved"), {"": said(SHOWN)}) as view:
        until(lambda: view.readers[0].count > 0)
        session = Session(view, saver)
        for _ in range(1000):
            session.take("save", 0, 1)
        first = session.message()
        assert first is not None
        assert len(saver.results) == 1
        saver.results[0].set_result("saved: there")
        second = session.message()
        assert second is not None
        assert ("notice" in text_of(first), text_of(second)["notice"]) == (False, "saved: there")
        session.take("save", 0, 1)
        assert len(saver.results) == 2


def test_injections_are_saved_once_and_as_a_disk_bears(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("observer_rt.desk.live_page.server.MOST_SAVED", 2)
    saver = Saver(tmp_path)
    said_of = [saver.save(ShownInjection(count, 5, {"number": 7}), "").result(20.0) for count in (1, 1, 2, 3, 1)]
    saver.close()
    first, second = (f"saved: {tmp_path / name}.csv, .json" for name in ("injection_7", "injection_7_2"))
    assert said_of[:3] == [first, first, second]
    assert said_of[3].startswith("not saved: 2 injections are already")
    assert said_of[4] == first
    assert len(list(tmp_path.iterdir())) == 4


def test_a_folder_that_cannot_be_looked_into_is_told(tmp_path: Path) -> None:
    saver = Saver(tmp_path / ("x" * 300))
    assert "File name too long" in saver.save(SHOWN, "").result(20.0)
    saver.close()
