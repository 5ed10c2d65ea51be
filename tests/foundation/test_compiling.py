"""That Numba compiles is said once, and a bar is drawn meanwhile."""

import io
import threading
from collections.abc import Callable

import pytest
from numba import njit
from numba.core import event
from rich.console import Console

from observer_rt.foundation import compiling
from observer_rt.foundation.compiling import CompilingShown, tell_compiling
from tests.service.participants import PATIENCE, until


def _compile(seed: int) -> None:
    def function(x: float) -> float:
        return x + seed

    assert njit(function)(1.0) == 1.0 + seed


def _said(work: Callable[[], object], console: Console | None = None) -> list[str]:
    said: list[str] = []
    with event.install_listener("numba:compile", CompilingShown(said.append, console)):
        work()
    return said


def test_it_is_said_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiling, "PATIENCE", 0.0)

    def work() -> None:
        for seed in range(3):
            _compile(seed)

    (line,) = _said(work)
    assert "once for this version" in line


def test_a_moment_is_not_worth_a_word(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiling, "PATIENCE", 3600.0)
    assert _said(lambda: _compile(1)) == []


def test_a_bar_is_drawn_until_nothing_is_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    until(lambda: not _drawing())  # of a command that another test ran
    monkeypatch.setattr(compiling, "PATIENCE", 0.0)
    monkeypatch.setattr(compiling, "IDLE", 3600.0)
    screen = io.StringIO()
    shown = CompilingShown(lambda text: None, Console(file=screen, force_terminal=True, width=80))
    shown.on_start(event.Event("numba:compile", event.EventStatus.START))
    shown.on_end(event.Event("numba:compile", event.EventStatus.END))
    (thread,) = _drawing()
    until(lambda: "compiling functions" in screen.getvalue())
    monkeypatch.setattr(compiling, "IDLE", 0.0)
    thread.join(PATIENCE)
    assert not thread.is_alive()


def test_of_two_commands_of_one_process_the_last_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiling, "PATIENCE", 0.0)
    first: list[str] = []
    second: list[str] = []
    tell_compiling(first.append)
    tell_compiling(second.append)
    _compile(1)
    assert (len(first), len(second)) == (0, 1)


def _drawing() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == "compiling"]
