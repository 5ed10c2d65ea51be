"""One writer at a time, whatever became of the one before."""

import fcntl
import os
import signal
import subprocess
import sys
from pathlib import Path
from unittest.mock import Mock

import pytest

from observer_rt.daemon.lock import sole_writer
from observer_rt.foundation.errors import RunError, UserError

HOLDING = """
import sys
from pathlib import Path
from observer_rt.daemon.lock import sole_writer
with sole_writer(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


def holder(path: Path) -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDING, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    return process


def test_a_second_writer_is_told_of_the_first(tmp_path: Path) -> None:
    path = tmp_path / "state.json"
    with holder(path) as first:
        with pytest.raises(UserError, match=rf"in use by process {first.pid}\n  remedy: stop that one"):
            sole_writer(path).__enter__()
        first.communicate()
        with sole_writer(path):
            pass
    assert not list(tmp_path.iterdir())


def test_a_killed_writer_is_in_nobodys_way(tmp_path: Path) -> None:
    path = tmp_path / "state.json"
    with holder(path) as first:
        first.kill()
        assert first.wait() == -signal.SIGKILL
    assert (tmp_path / "state.json.lock").exists()
    with sole_writer(path), pytest.raises(UserError, match=f"process {os.getpid()}"):
        sole_writer(path).__enter__()


def test_who_waits_for_a_lock_of_an_earlier_version_does_not_get_it(tmp_path: Path) -> None:
    """Its file could be opened by all: it is replaced by one of the owner's alone."""
    path, lock = tmp_path / "state.json", tmp_path / "state.json.lock"
    lock.write_text("987654")
    lock.chmod(0o644)
    with lock.open() as stranger, sole_writer(path):
        assert lock.stat().st_mode & 0o777 == 0o600
        fcntl.flock(stranger, fcntl.LOCK_SH | fcntl.LOCK_NB)  # of a file that is no more
        with pytest.raises(UserError, match=f"process {os.getpid()}"):
            sole_writer(path).__enter__()


def test_a_lock_held_by_another_than_its_writer_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, lock = tmp_path / "state.json", tmp_path / "state.json.lock"
    lock.write_text("987654")  # of a process that was killed
    with lock.open() as stranger:
        fcntl.flock(stranger, fcntl.LOCK_EX)
        said = (
            rf"held by process {os.getpid()} \(.+\) of user id {os.getuid()}, not by process 987654.*\n.*or remove "
        )
        with pytest.raises(RunError, match=said + str(lock)) as refused:
            sole_writer(path).__enter__()
        assert refused.value.exit_code == 1  # so that a supervisor tries again
        monkeypatch.setattr(Path, "read_text", Mock(side_effect=OSError))  # as where /proc/locks does not tell
        with pytest.raises(
            UserError, match=r"process 987654 of another container or.*\n.*remove /.* if it has ended"
        ):
            sole_writer(path).__enter__()


def test_the_lock_outlives_the_file_it_guards(tmp_path: Path) -> None:
    """State files are replaced: a lock on the file itself would go with the old one."""
    path = tmp_path / "state.json"
    with sole_writer(path):
        for _ in range(2):
            (tmp_path / "new").write_text("{}")
            (tmp_path / "new").replace(path)
            with pytest.raises(UserError, match="in use"):
                sole_writer(path).__enter__()


def test_one_file_by_two_names(tmp_path: Path) -> None:
    (tmp_path / "link.json").symlink_to(tmp_path / "state.json")
    with sole_writer(tmp_path / "state.json"), pytest.raises(UserError, match="in use"):
        sole_writer(tmp_path / "link.json").__enter__()


def test_a_lock_that_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "state.json.lock").mkdir()
    with pytest.raises(UserError, match=r"state\.json\.lock: cannot be locked: Is a directory"):
        sole_writer(tmp_path / "state.json").__enter__()


def test_a_lock_removed_by_hand_while_it_is_held(tmp_path: Path) -> None:
    """Then there are two writers, but the first one's end does not take the second one's lock along."""
    path = tmp_path / "state.json"
    first = sole_writer(path)
    first.__enter__()
    (tmp_path / "state.json.lock").unlink()
    with sole_writer(path):
        first.__exit__(None, None, None)
        with pytest.raises(UserError, match="in use"):
            sole_writer(path).__enter__()
