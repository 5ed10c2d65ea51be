"""Progress of long work, with a bar and where none is seen."""

import io

import pytest
from rich.console import Console

from observer_rt.foundation.console import progress_bar


def test_long_work_says_how_far_it_is_where_there_is_no_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """A line now and then: short work stays silent, and a log does not fill."""
    times, text = iter((0.0, 29.0, 31.0, 31.0, 40.0, 62.0, 62.0)), io.StringIO()
    monkeypatch.setattr("observer_rt.foundation.console.monotonic", lambda: next(times))
    with progress_bar(Console(file=text), "fitting", 4.0) as update:
        for done in (1.0, 2.0, 3.0, 4.0):
            update(done)
    assert text.getvalue() == "fitting: 50%\nfitting: 100%\n"


def test_a_terminal_obeys_no_name_of_a_file() -> None:
    text = io.StringIO()
    with progress_bar(Console(file=text, force_terminal=True), "reading [red]\x1b[2J", None):
        pass
    assert r"reading [red]\x1b[2J" in text.getvalue()
