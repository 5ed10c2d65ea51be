"""The daemon's local socket: requests and answers, whoever asks, and however long its path is."""

import json
import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from observer_rt.daemon.control_socket import LONGEST, MOST_CLIENTS, Message, ask, control_socket
from observer_rt.daemon.lock import sole_writer
from observer_rt.foundation.errors import RunError, UserError


def refuse(_: Message) -> Message:
    raise UserError("bench.toml", "is wrong", "correct it")


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def kept(tmp_path: Path, said: list[str]) -> Iterator[Path]:
    """A file that a daemon keeps, in a folder whose name is longer than the address of a socket may be."""
    folder = tmp_path / ("evidence" * 20)
    folder.mkdir()
    with control_socket(
        folder / "observer",
        {"double": lambda asked: {"is": int(2 * asked["of"])}, "fail": refuse, "snapshot": lambda _: {}},
        said.append,
    ):
        yield folder / "observer"


@pytest.fixture
def client(kept: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[socket.socket]:
    monkeypatch.chdir(kept.parent)
    with socket.socket(socket.AF_UNIX) as connection:
        connection.settimeout(20.0)
        connection.connect("observer.socket")
        yield connection


def test_a_request_is_answered_or_refused_in_words(kept: Path) -> None:
    assert ask(kept, {"request": "double", "of": 21}) == {"is": 42}
    with pytest.raises(UserError, match="is wrong"):
        ask(kept, {"request": "fail"})
    with pytest.raises(UserError, match="known: double, fail, snapshot"):
        ask(kept, {"request": "triple"})


@pytest.mark.parametrize(
    "line",
    [b"\n", b"\xff\n", b"[1]\n", b'{"request": []}\n', b"[" * 60000 + b"\n", b'{"request": "double", "of": 1e999}\n'],
)
def test_nonsense_is_refused_and_the_client_goes_on(client: socket.socket, line: bytes) -> None:
    with client.makefile("rb") as answers:
        client.sendall(line)
        assert "error" in json.loads(answers.readline())
        client.sendall(b'{"request": "double", "of": 1}\n')
        assert json.loads(answers.readline()) == {"is": 2}


def test_a_line_without_end_is_hung_up_on(client: socket.socket) -> None:
    client.sendall(b" " * LONGEST)
    assert client.recv(1) == b""


def test_clients_are_limited_and_silent_ones_do_no_harm(kept: Path, client: socket.socket, said: list[str]) -> None:
    others = [socket.socket(socket.AF_UNIX) for _ in range(MOST_CLIENTS)]
    for other in others:
        other.settimeout(20.0)
        other.connect("observer.socket")
    assert others[-1].recv(1) == b""  # one too many
    with pytest.raises(RunError, match="does not answer"):
        ask(kept, {"request": "double", "of": 1})
    assert [f"process {os.getpid()}" in each for each in said] == [True]
    for other in others:
        other.close()
    client.sendall(b'{"request": "double", "of": 1}\n')
    assert json.loads(client.recv(100)) == {"is": 2}


_NOBODY = """import os, socket, sys
from pathlib import Path
from observer_rt.daemon.control_socket import ask
os.chdir(sys.argv[1]); os.setgroups([]); os.setgid(65534); os.setuid(65534)
"""
_ASK = f"""{_NOBODY}
print(ask(Path("observer"), {{"request": "snapshot"}}), ask(Path("observer"), {{"request": "double", "of": 1}}))
"""
_HOLD = f"""{_NOBODY}
held = [socket.socket(socket.AF_UNIX) for _ in range({2 * MOST_CLIENTS})]
for each in held:
    each.connect("observer.socket")
print("held", flush=True)
input()
"""


@pytest.fixture
def open_to_others(kept: Path) -> None:
    if os.geteuid() != 0:
        pytest.skip("only the administrator can be another user")
    for folder in (kept.parent, *kept.parents):
        with suppress(PermissionError):
            folder.chmod(folder.stat().st_mode | 0o111)


@pytest.mark.usefixtures("open_to_others")
def test_other_users_that_hold_all_their_places_keep_nobody_else_out(kept: Path, said: list[str]) -> None:
    words = [sys.executable, "-c", _HOLD, str(kept.parent)]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"held\n"
        for of in range(MOST_CLIENTS):
            assert ask(kept, {"request": "double", "of": of}) == {"is": 2 * of}
        other.communicate(b"\n")
    assert ["user 65534" in each for each in said] == [True]


@pytest.mark.usefixtures("open_to_others")
def test_other_users_may_look_only(kept: Path) -> None:
    asked = subprocess.run([sys.executable, "-c", _ASK, kept.parent], capture_output=True, text=True, check=False)
    assert "its daemon refuses: user root and its group alone" in asked.stderr


def test_a_socket_left_behind_is_replaced_and_ours_removed(tmp_path: Path) -> None:
    kept, path = tmp_path / "observer", tmp_path / "observer.socket"
    with socket.socket(socket.AF_UNIX) as killed:
        killed.bind(str(path))
    assert ask(kept, {"request": "double", "of": 1}) is None
    with control_socket(kept, {"double": lambda asked: {"is": 2 * asked["of"]}}):
        assert ask(kept, {"request": "double", "of": 1}) == {"is": 2}
    assert not path.exists()


def test_a_daemon_without_a_socket_cannot_be_asked(tmp_path: Path) -> None:
    assert ask(tmp_path / "observer", {}) is None
    with sole_writer(tmp_path / "observer"), pytest.raises(RunError, match="takes no requests"):
        ask(tmp_path / "observer", {})
