"""MDF4 files are read in a process of its own: what it gives, its errors, and whatever else becomes of it."""

import os
import signal
import struct
import subprocess
import sys
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

from observer_rt.files.mdf4.reader_process import READABLE, Answer, mdf4_apart
from observer_rt.foundation.errors import UserError
from tests.files.mdf4.apart_work import ARRAYS

CRASH = "a damaged MDF file: what reads it crashed, or did not come to an end"
REPOSITORY = Path(__file__).parents[3]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    (tmp_path / "x.mf4").write_text("one\ntwo")
    return tmp_path / "x.mf4"


def apart(function: str, path: Path, *arguments: str) -> Iterator[Answer]:
    return mdf4_apart(f"tests.files.mdf4.apart_work:{function}", path, *arguments)


def values(function: str, path: Path, *arguments: str) -> list[object]:
    return [value for value, _ in apart(function, path, *arguments)]


def refusal(work: Iterator[Answer]) -> tuple[str, str, str]:
    with pytest.raises(UserError) as raised:
        list(work)
    return raised.value.location, raised.value.problem, raised.value.remedy


def test_what_it_yields(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(path.parent)
    assert values("lines", Path(path.name), "> ") == ["> one", "> two"]
    _, arrays = next(apart("lines", path, ""))
    assert list(arrays) == list(ARRAYS)
    for name, expected in ARRAYS.items():
        assert arrays[name].dtype == expected.dtype
        np.testing.assert_array_equal(arrays[name], expected)


def pickled() -> bytes:
    np.save(file := BytesIO(), np.array([CRASH], object), allow_pickle=True)
    return file.getvalue()


def message(*parts: bytes) -> bytes:
    return b"".join(struct.pack("!i", len(part)) + part for part in parts)


@pytest.mark.parametrize("content", [b"\xff" * 100, message(b"1"), message(b'[1, ["a"]]', pickled())])
def test_an_answer_that_is_none_is_a_crash(path: Path, content: bytes) -> None:
    path.write_bytes(content)
    assert refusal(apart("taken_over", path)) == (str(path), CRASH, READABLE)


def test_several_at_once_and_given_up(path: Path) -> None:
    first, second = apart("lines", path, ""), apart("lines", path, "")
    assert [next(each)[0] for each in (first, second, second)] == ["one", "one", "two"]


def test_nothing_reaches_the_screen(path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert values("noisy", path) == [1]
    assert capfd.readouterr() == ("", "")


def test_errors_of_the_user_come_as_they_are(path: Path) -> None:
    work = apart("refusing", path)
    assert next(work) == (1, {})
    assert refusal(work) == (str(path), "is damaged", "write it again")


@pytest.mark.parametrize(
    ("function", "error"),
    [("failing", "ZeroDivisionError: integer"), ("greedy", "MemoryError"), ("objects", "ValueError: Object arrays")],
)
def test_any_other_error_is_named_and_memory_is_bounded(path: Path, function: str, error: str) -> None:
    location, problem, remedy = refusal(apart(function, path))
    assert (location, remedy) == (str(path), READABLE)
    assert problem.startswith(f"a damaged MDF file: {error}")


def test_time_is_bounded(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("observer_rt.files.mdf4.reader_process.CPU_SECONDS", 1)
    assert refusal(apart("endless", path)) == (str(path), CRASH, READABLE)


def test_a_crash_is_an_error_after_what_came_before_and_its_files_are_deleted(path: Path) -> None:
    work = apart("littering", path)
    left = Path(next(work)[0])
    assert left.exists()
    assert refusal(work) == (str(path), CRASH, READABLE)
    assert not left.parent.exists()


def test_a_server_that_died_is_replaced(path: Path) -> None:
    (before,) = values("server", path)
    assert isinstance(before, int)
    os.kill(before, signal.SIGKILL)
    os.waitid(os.P_PID, before, os.WEXITED | os.WNOWAIT)
    (after,) = values("server", path)
    assert after != before


def test_a_script_without_a_main_guard(path: Path) -> None:
    script = path.with_suffix(".py")
    lines = ["from tests.files.mdf4.test_reader_process import *", f"print(values('lines', Path({str(path)!r}), ''))"]
    script.write_text("\n".join(lines))
    environment = os.environ | {"PYTHONPATH": str(REPOSITORY)}
    result = subprocess.run([sys.executable, script], env=environment, capture_output=True, text=True, check=True)
    assert result.stdout == "['one', 'two']\n"
