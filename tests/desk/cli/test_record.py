"""`observer-rt record` on the virtual bus of this process."""

import os
import signal
import threading
import time
from pathlib import Path

import can

from observer_rt.files.formats import open_log
from tests.desk.cli.conftest import Command
from tests.meanwhile import meanwhile

CHANNEL = "record-test"
ON_BUS = ("--interface", "virtual", "--channel", CHANNEL)


def send(over: threading.Event) -> None:
    """Frames on the bus, classic and FD by turns, with the number of each as its content."""
    with can.Bus(interface="virtual", channel=CHANNEL, fd=True) as bus:
        number = 0
        while not over.wait(0.001):
            data = number.to_bytes(8, "big")
            bus.send(can.Message(arbitration_id=0x123, is_extended_id=False, is_fd=number % 2 == 1, data=data))
            number += 1


def test_a_signal_completes_the_file(command: Command, tmp_path: Path) -> None:
    path = tmp_path / "bus.blf"

    def interrupt(_: threading.Event) -> None:
        while not path.exists():
            time.sleep(0.01)
        time.sleep(0.1)
        os.kill(os.getpid(), signal.SIGINT)

    with meanwhile(send), meanwhile(interrupt):
        outcome = command("record", "--out", path, *ON_BUS)
    assert outcome.code == 0
    log = open_log(path)
    assert len(list(log)) > 0
    assert log.notes() == []
    assert "0 lost" in outcome.out


def test_an_interface_that_is_not_there_is_a_failure_at_run_time(command: Command, tmp_path: Path) -> None:
    outcome = command("record", "--out", tmp_path / "bus.blf", "--channel", "can_none_here")
    assert (outcome.code, "remedy: " in outcome.err) == (1, True)
    assert not list(tmp_path.iterdir())
