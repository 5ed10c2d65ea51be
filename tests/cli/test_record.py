"""`observer-rt record` on the virtual bus of this process."""

import json
import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import can
import pytest

from observer_rt.recording.formats import open_log
from tests.cli.conftest import Command

CHANNEL = "record-test"
ON_BUS = ("--interface", "virtual", "--channel", CHANNEL)


@contextmanager
def sending() -> Iterator[None]:
    """Frames on the bus, classic and FD by turns, with the number of each as its content."""
    over = threading.Event()

    def send() -> None:
        with can.Bus(interface="virtual", channel=CHANNEL, fd=True) as bus:
            number = 0
            while not over.wait(0.001):
                data = number.to_bytes(8, "big")
                bus.send(
                    can.Message(arbitration_id=0x123, is_extended_id=False, is_fd=number % 2 == 1, data=data)
                )
                number += 1

    sender = threading.Thread(target=send)
    sender.start()
    try:
        yield
    finally:
        over.set()
        sender.join()


@pytest.mark.parametrize("suffix", [".blf", ".log"])
def test_a_bus_is_recorded_frame_by_frame(command: Command, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"bus{suffix}"
    with sending():
        outcome = command("record", "--out", path, *ON_BUS, "--frames", 50, "--json")
    assert outcome.code == 0
    assert json.loads(outcome.out)["frames"] == 50
    assert json.loads(outcome.out)["files"] == [str(path)]
    frames = list(open_log(path))
    numbers = [int.from_bytes(found.frame.payload, "big") for found in frames]
    assert numbers == list(range(numbers[0], numbers[0] + 50))
    assert [found.frame.is_fd for found in frames] == [number % 2 == 1 for number in numbers]
    assert abs(frames[-1].frame.stamp_ns / 1e9 - time.time()) < 60.0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_completes_the_file(command: Command, tmp_path: Path, number: signal.Signals) -> None:
    path = tmp_path / "bus.blf"

    def interrupt() -> None:
        while not path.exists():
            time.sleep(0.01)
        time.sleep(0.1)
        os.kill(os.getpid(), number)

    interrupter = threading.Thread(target=interrupt)
    with sending():
        interrupter.start()
        outcome = command("record", "--out", path, *ON_BUS)
        interrupter.join()
    assert outcome.code == 0
    log = open_log(path)
    assert len(list(log)) > 0
    assert log.notes() == []
    assert "0 lost" in outcome.out


def test_files_are_not_overwritten(command: Command, tmp_path: Path) -> None:
    path = tmp_path / "bus.log"
    path.write_text("mine")
    assert "exists already" in command.refused("record", "--out", path, *ON_BUS, "--duration", 0.1)
    assert path.read_text() == "mine"


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("--out", "bus.mf4"), 2, "cannot be recorded into safely"),
        (("--out", "nowhere/bus.blf"), 2, "no such folder"),
        (("--out", "bus.blf", "--interface", "nosuch"), 2, "unknown interface 'nosuch'"),
        (("--out", "bus.blf", "--interface", "socketcan", "--channel", "can_none_here"), 1, "remedy: "),
    ],
)
def test_mistakes_are_named(
    command: Command,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: tuple[str, ...],
    code: int,
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    outcome = command("record", *arguments)
    assert outcome.code == code
    assert message in outcome.err
    assert not list(tmp_path.iterdir())
