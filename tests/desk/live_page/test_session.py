"""What a browser is sent comes back out of its messages, and not more of them than it can draw; what is saved."""

import json
import math
import threading
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from observer_rt.bus.mapping.output_signals import SummaryValues
from observer_rt.config.bench import load_bench
from observer_rt.desk.live_page.page.session import Session, packed, pressed, save_injection
from observer_rt.desk.live_page.samples import SampleCurves, SeenInjection
from observer_rt.desk.live_page.watching import FrameSource, Taker, Watching
from tests.desk.live_page.message import unpacked

_VALUES = st.lists(st.floats(width=32), max_size=20).map(lambda each: np.array(each, np.float32))
_PARTS = st.dictionaries(st.text(), st.dictionaries(st.text(), _VALUES))


@given(_PARTS, st.dictionaries(st.text(), st.text()))
def test_columns_come_back_out_of_a_message(
    parts: dict[str, dict[str, np.ndarray]], letters: dict[str, str]
) -> None:
    said, columns = unpacked(packed({"letters": letters}, parts))
    assert said == {"letters": letters}
    assert columns.keys() == parts.keys()
    for name, part in parts.items():
        assert columns[name].keys() == part.keys()
        for column, values in part.items():
            np.testing.assert_array_equal(columns[name][column], values)


class Silent(FrameSource):
    """Nothing comes."""

    def run(self, take: Taker, stop: threading.Event) -> None:
        stop.wait()


@pytest.fixture
def session(tmp_path: Path) -> Session:
    return Session(Watching(load_bench(), Silent()), tmp_path)


_JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.sampled_from(["drawn", "hold", "choose", "place", "?"]),
    lambda inner: st.lists(inner, max_size=3),
)


@given(st.text() | st.binary() | _JSON.map(json.dumps))
@example("[" * 100_000)
@example('["choose", 7]')
@example('["drawn", 1e999]')
@example('["drawn", -2]')
def test_whatever_is_said_is_a_button_or_nothing(message: str | bytes) -> None:
    """And a button that there is not does no harm."""
    found = pressed(message)
    if found is None:
        return
    session = Session(Watching(load_bench(), Silent()), Path())
    session.take(*found)
    assert session.message() is not None


def test_a_browser_that_claims_to_be_ahead_is_sent_no_more(session: Session) -> None:
    session.take("drawn", 10**9)
    assert len(sent_until_behind(session)) in (1, 2, 3)


def sent_until_behind(session: Session) -> list[bytes]:
    """There is always something new: somebody presses a button all the time."""
    sent = []
    while (message := session.message()) is not None:
        sent.append(message)
        session.take("hold", 0)
    return sent


def test_a_browser_that_does_not_answer_is_sent_no_more(session: Session) -> None:
    for _ in range(3):
        sent = sent_until_behind(session)
        assert len(sent) in (1, 2, 3)
        said, _columns = unpacked(sent[-1])
        session.take("drawn", said["number"])


def test_nothing_new_is_no_message(session: Session) -> None:
    first = session.message()
    assert first is not None
    said, _ = unpacked(first)
    assert "no injection yet" in said["letters"]["numbers_0"]
    session.take("drawn", said["number"])
    assert session.message() is None


def test_without_injections_there_is_nothing_to_step_to_or_to_save(session: Session, tmp_path: Path) -> None:
    for button, value in (("step", -1), ("place", 7), ("save", 0)):
        session.take(button, value)
    message = session.message()
    assert message is not None
    controls = unpacked(message)[0]["controls"]
    assert (controls["held"], controls["place"], controls["said"]) == (True, 0, "there is no injection yet")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("samples", [None, 3])
def test_what_is_not_known_is_null_and_not_a_number_no_json_has(tmp_path: Path, samples: int | None) -> None:
    summary = SummaryValues._make([math.nan] * len(SummaryValues._fields))._replace(injection_number=7)
    line = np.full(samples or 0, 0.01, np.float32)
    curves = None if samples is None else SampleCurves._make([line] * len(SampleCurves._fields))
    path = save_injection(SeenInjection(summary, 5, curves), tmp_path, "left")

    assert path == tmp_path / "injection_left_7.csv"
    text = path.with_suffix(".json").read_text()
    assert "NaN" not in text
    said = json.loads(text)
    assert (said["nominal_mass"], said["mass"], said["injection_number"]) == (None, None, 7)
    header, *rows = path.read_text().splitlines()
    assert header.startswith("time_s,rail_pressure_MPa,needle_lift_mm,")
    assert rows == ["1e-05,0.01,1e-05,0.01,0.01,0.01,0.01,0.01,0.01"] * line.size  # not 9.99999978e-06


def test_saving_takes_a_name_that_is_free(tmp_path: Path) -> None:
    summary = SummaryValues._make([math.nan] * len(SummaryValues._fields))._replace(injection_number=7)
    (tmp_path / "injection_7.csv").write_text("mine")
    (tmp_path / "injection_7_2.json").write_text("mine")
    saved = [save_injection(SeenInjection(summary, 5, None), tmp_path, "").name for _ in range(2)]
    assert saved == ["injection_7_3.csv", "injection_7_4.csv"]
    assert (tmp_path / "injection_7.csv").read_text() == "mine"
