"""Work in a process of its own: its results, its errors, and whatever else becomes of it."""

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.sandbox import WorkerError, run_apart


def apart(function: str, path: Path = Path("nothing")) -> Iterator[Any]:
    return run_apart("tests.foundation.apart_work", function, path)


def test_what_it_yields(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("one\ntwo")
    monkeypatch.chdir(tmp_path)
    assert list(apart("lines", Path("file"))) == ["one", "two"]


def test_several_at_once_and_given_up(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("one\ntwo")
    first, second = apart("lines", tmp_path / "file"), apart("lines", tmp_path / "file")
    assert [next(first), next(second), next(second)] == ["one", "one", "two"]


def test_nothing_reaches_the_screen(capfd: pytest.CaptureFixture[str]) -> None:
    assert list(apart("noisy")) == [1]
    assert capfd.readouterr() == ("", "")


def test_a_crash_is_an_error_after_what_came_before() -> None:
    work = apart("crashing")
    assert next(work) == 1
    with pytest.raises(WorkerError, match="crashed, or did not come to an end"):
        next(work)


def test_errors_of_the_user_and_of_the_system_come_as_they_are(tmp_path: Path) -> None:
    with pytest.raises(UserError) as raised:
        list(apart("refusing"))
    assert (raised.value.place, raised.value.problem, raised.value.remedy) == (
        "nothing",
        "is damaged",
        "mend it",
    )
    with pytest.raises(FileNotFoundError):
        list(apart("lines", tmp_path / "absent"))


def test_any_other_error_is_named() -> None:
    with pytest.raises(WorkerError, match="ZeroDivisionError: integer"):
        list(apart("failing"))


def test_memory_is_bounded() -> None:
    with pytest.raises(WorkerError, match="MemoryError"):
        list(apart("greedy"))


def test_time_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("observer_rt.foundation.sandbox.CPU_SECONDS", 1)
    with pytest.raises(WorkerError, match="crashed, or did not come to an end"):
        list(apart("endless"))


def test_what_it_leaves_behind_is_deleted() -> None:
    work = apart("littering")
    name = Path(next(work))
    assert name.exists()
    with pytest.raises(WorkerError):
        next(work)
    assert not name.exists()
    assert not name.parent.exists()


def is_dead(process: int) -> bool:
    """Whether nothing of a process is left but its status: its threads end one after the other."""
    folder = Path(f"/proc/{process}")
    state = (folder / "stat").read_text().rpartition(")")[2].split()[0]
    return state == "Z" and len(list((folder / "task").iterdir())) == 1


def test_a_server_that_died_is_replaced() -> None:
    (before,) = apart("parent")
    os.kill(before, signal.SIGKILL)
    while not is_dead(before):
        time.sleep(0.01)
    (after,) = apart("parent")
    assert after != before
