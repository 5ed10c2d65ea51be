"""The terminal view: all on one screen, whatever its size."""

import time
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.daemon.view import View
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.service.nominal import ComparedRate
from tests.daemon.participants import HeardDaemon, ScriptedLink, bench_file, drawn, serving, until
from tests.device import frames_of, worn_recording


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return bench_file(tmp_path, "view-test")


@pytest.fixture
def view(path: Path) -> View:
    def references(report: InjectionReport, rows: NDArray[np.void]) -> list[ComparedRate]:
        return [ComparedRate("bought", np.full(len(rows), 50e-6), 123.45e-6)]

    link = ScriptedLink(frames_of(path, worn_recording(injections=12)))
    daemon = HeardDaemon(path, link, references=references)
    with serving(daemon):
        until(link.empty.is_set)
    return daemon.view


@pytest.mark.parametrize(("width", "height"), [(80, 24), (80, 50), (120, 40), (200, 60)])
def test_fits_the_terminal_and_shows_it_all(view: View, width: int, height: int) -> None:
    lines = drawn(view, width, height)
    assert len(lines) <= height
    assert max(map(len, lines)) <= width
    text = "\n".join(lines)
    for expected in (
        *("title of the view", "ADAPTED", "observing with what was learned"),
        *("123.45", "bought", "learned 12 times in 12 events"),
        "noise: rail 0.1 MPa, line 0.15 MPa, lift 0.4 um",
        *("error-active", "stamps by arrival", "unsent 0", "ms ago", time.strftime("%Y-%m-%d")),
    ):
        assert expected in text
    assert "…" not in text  # nothing was cut
    assert "12  120" in text  # the table's last row


def test_failed_writes_are_shown_once_there_are_any(path: Path) -> None:
    failed = 0
    daemon = HeardDaemon(path, ScriptedLink(), failed_writes=lambda: failed)
    assert "failed writes" not in daemon.drawn()
    failed = 3
    assert "3 failed writes of learned state, journal or log" in daemon.drawn()


def test_an_input_that_stays_away_is_named(view: View) -> None:
    until(lambda: "INPUT_TIMEOUT: no frame of any input comes" in "\n".join(drawn(view, 100, 30)))
    assert "SampleBlock 0x100 (rail_pressure, needle_lift, line_pressure) " in "\n".join(drawn(view, 100, 30))


@pytest.mark.parametrize(("width", "height"), [(30, 8), (10, 3)])
def test_tiny_terminal_is_survived(view: View, width: int, height: int) -> None:
    assert drawn(view, width, height)


def test_before_the_first_injection(path: Path) -> None:
    text = HeardDaemon(path, ScriptedLink()).drawn()
    assert "WAITING_FOR_DATA" in text
    assert "no injection yet" in text
