"""Work in a process of its own: its results, its errors, and whatever else becomes of it."""

import json
import math
import os
import pickle
import signal
import struct
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.sandbox import WorkerError, checked, run_apart
from tests.foundation.apart_work import ARRAYS


def apart(function: str, path: Path = Path("nothing")) -> Iterator[Any]:
    return run_apart("tests.foundation.apart_work", function, path)


def test_what_it_yields(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("one\ntwo")
    monkeypatch.chdir(tmp_path)
    assert list(apart("lines", Path("file"))) == ["one", "two"]


def test_plain_data_come_as_they_are(tmp_path: Path) -> None:
    text, flag, nothing, number, nested, *arrays = next(apart("plain", tmp_path))
    assert (text, flag, nothing) == (str(tmp_path), True, None)
    assert math.isnan(number)
    assert nested == {"type": [1, [2, "a"]], "fields": {}}
    for array, expected in zip(arrays, ARRAYS, strict=True):
        assert array.dtype == expected.dtype
        np.testing.assert_array_equal(array, expected)


@pytest.mark.parametrize(
    ("function", "kind"), [("an_object", "Path"), ("objects", "ndarray"), ("numbered", "dict"), ("a_set", "set")]
)
def test_anything_else_is_refused(function: str, kind: str) -> None:
    with pytest.raises(WorkerError, match=f"TypeError: .*{kind}.* no plain data"):
        list(apart(function))


class Harmful:
    """A thing whose pickle makes a file where it is loaded."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, (str(self._path),)


def message(content: Any) -> bytes:
    text = json.dumps(content).encode()
    return struct.pack("<Q", len(text)) + text


def array(kind: Any, *shape: Any, data: bytes = b"") -> bytes:
    """An answer with an array, whose type, shape and bytes are as stated."""
    heading = repr({"descr": kind, "fortran_order": False, "shape": shape}).encode()
    stored = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(heading)) + heading + data
    return message(["item", {"array": 1}]) + struct.pack("<Q", len(stored)) + stored


HOSTILE = {
    "garbage": b"\xff" * 100,
    "no JSON": struct.pack("<Q", 4) + b"ab(c",
    "a huge length": struct.pack("<Q", 1 << 62),
    "less than announced": struct.pack("<Q", 100) + b"[",
    "deep nesting": struct.pack("<Q", 1 << 20) + b"[" * (1 << 20),
    "no kind": message(["other", 1]),
    "no pair": message("item"),
    "not what an error has": message(["user error", [1]]),
    "a huge array": array("<f8", 1 << 50),
    "overflow": array("<f8", 1 << 62, 1 << 62),
    "a shape below zero": array("<f8", -1),
    "a shape of text": array("<f8", "a"),
    "an array that ends early": array("<f8", 3, data=bytes(8)),
    "objects": array("|O", 1, data=bytes(8)),
    "objects in records": array([("a", "<f8"), ("b", "|O")], 1, data=bytes(16)),
    "no array": message(["item", {"array": 1}]),
    "a type as an expression": array("__import__('os').abort()", 1),
    "an odd dictionary": message(["item", {"other": 1}]),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_answer_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "file").write_bytes(HOSTILE[name])
    with pytest.raises(WorkerError):
        list(apart("taken_over", tmp_path / "file"))


@pytest.mark.parametrize("prefix", [b"", struct.pack("<Q", 1000)])
def test_nothing_in_an_answer_is_executed(tmp_path: Path, prefix: bytes) -> None:
    (tmp_path / "file").write_bytes(prefix + pickle.dumps(Harmful(tmp_path / "executed")))
    with pytest.raises(WorkerError, match="no answer that can be read"):
        list(apart("taken_over", tmp_path / "file"))
    assert not (tmp_path / "executed").exists()


def test_an_answer_is_checked() -> None:
    assert checked(TypeAdapter(tuple[int, str]), [1, "a"]) == (1, "a")
    with pytest.raises(WorkerError, match="something else than was asked for"):
        checked(TypeAdapter(tuple[int, str]), {"a": 1})


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


def test_errors_of_the_user_come_as_they_are() -> None:
    with pytest.raises(UserError) as raised:
        list(apart("refusing"))
    error = raised.value
    assert (error.location, error.problem, error.remedy) == ("nothing", "is damaged", "write it again")


@pytest.mark.parametrize(("work", "error"), [("failing", "ZeroDivisionError: integer"), ("greedy", "MemoryError")])
def test_any_other_error_is_named_and_memory_is_bounded(work: str, error: str) -> None:
    with pytest.raises(WorkerError, match=error):
        list(apart(work))


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
