"""The terminal view: everything on one screen, whatever its size."""

import io
import time
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.recording.replay.framing import Framer, whole
from observer_rt.service.daemon import Daemon
from observer_rt.service.reports.injection_report import InjectionReport
from observer_rt.service.view import Reference, View
from tests.service.participants import SAMPLE_RATE, ScriptedLink, bench_file, serving, until, worn_recording


def drawn(view: View, width: int, height: int) -> list[str]:
    """Lines on a terminal of this size."""
    file = io.StringIO()
    console = Console(file=file, width=width, height=height, force_terminal=True, color_system=None)
    console.print(view.render(time.monotonic_ns(), width, height))
    return file.getvalue().splitlines()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return bench_file(tmp_path, "view-test")


@pytest.fixture
def view(path: Path) -> View:
    """After twelve injections, compared with a reference."""
    recording = worn_recording(injections=12)

    def references(report: InjectionReport) -> list[Reference]:
        return [Reference("nominal", np.full(report.end - report.start + 1, 50e-6), 123.45e-6)]

    bench = load_bench(path)
    view = View("title of the view", SAMPLE_RATE, references)
    link = ScriptedLink(Framer(map_bus(bench)).frames(recording, whole(recording)))
    daemon = Daemon(bench, map_bus(bench), [link], listeners=[view.hear])
    view.watch(daemon)
    with serving(daemon):
        until(link.empty.is_set)
    return view


@pytest.mark.parametrize(("width", "height"), [(80, 24), (80, 50), (120, 40), (200, 60)])
def test_fits_the_terminal_and_shows_it_all(view: View, width: int, height: int) -> None:
    lines = drawn(view, width, height)
    assert len(lines) <= height
    assert max(map(len, lines)) <= width
    text = "\n".join(lines)
    for expected in (
        *("title of the view", "ADAPTED", "adopted", "injection 12 at 120 MPa", "123.45", "v_H"),
        *("error-active", "stamps by arrival", "unsent 0"),
    ):
        assert expected in text
    assert "…" not in text  # nothing was cut
    assert "12  120" in text  # the table's last row


def test_more_injections_where_there_is_room(view: View) -> None:
    shown = [sum("valid" in line for line in drawn(view, 80, height)) for height in (24, 50)]
    assert 1 <= shown[0] < shown[1] == 8


@pytest.mark.parametrize(("width", "height"), [(30, 8), (10, 3)])
def test_tiny_terminal_is_survived(view: View, width: int, height: int) -> None:
    assert drawn(view, width, height)


def test_before_the_first_injection(path: Path) -> None:
    bench = load_bench(path)
    view = View("title", SAMPLE_RATE)
    assert "starting" in "\n".join(drawn(view, 80, 24))
    view.watch(Daemon(bench, map_bus(bench), [ScriptedLink()], listeners=[view.hear]))
    text = "\n".join(drawn(view, 80, 24))
    assert "WAITING_FOR_DATA" in text
    assert "no injection yet" in text
