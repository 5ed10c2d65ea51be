"""What the operating system refuses is one error, with what to do."""

import sys
import threading
from pathlib import Path

import pytest

from observer_rt.desk.cli.app import main
from tests.daemon.participants import bench_file


def test_no_more_threads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def refuse(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")  # in Python's words, as under `ulimit -v`

    monkeypatch.setattr(sys, "argv", ["observer-rt", "run", "--bench", str(bench_file(tmp_path, "limits"))])
    monkeypatch.setattr(threading.Thread, "start", refuse)
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 1
    said = capfd.readouterr().err
    assert "error: this process may start no more threads" in said
    assert "ulimit -v" in said
