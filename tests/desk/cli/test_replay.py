"""`observer-rt replay` onto the virtual bus of this process: what arrives, and mistakes it names."""

import json
import os
import signal
import threading
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import can
import cantools.database
import pytest

from observer_rt.config.bench import PACKAGE_DATA
from tests.desk.cli.conftest import Command, Outcome

CHANNEL = "replay-test"
ON_BUS = ("--interface", "virtual", "--channel", CHANNEL)
BLOCK = cantools.database.load_file(PACKAGE_DATA / "observer_fd.dbc").get_message_by_name("SampleBlock")


@pytest.fixture
def bus() -> Iterator[can.BusABC]:
    with can.Bus(interface="virtual", channel=CHANNEL, fd=True) as bus:
        yield bus


def received(bus: can.BusABC) -> list[can.Message]:
    messages = []
    while (message := bus.recv(0.0)) is not None:
        messages.append(message)
    return messages


def indices(messages: list[can.Message]) -> list[int]:
    return [int(BLOCK.decode(bytes(m.data), scaling=False)["SampleIndex"]) for m in messages]


def test_part_in_loops_and_json(command: Command, bus: can.BusABC, worn: Path) -> None:
    part = ("--start", "0.1", "--stop", "0.11", "--loop", "2", "--json")
    outcome = command.done("replay", worn, *ON_BUS, "--speed", "1", *part)
    content = json.loads(outcome.out)
    messages = received(bus)
    assert content["frames"] == len(messages) == pytest.approx(2 * 500 / 9, abs=2)
    assert 0.018 <= content["duration_s"] <= 0.2
    assert content["lateness_median_s"] >= 0.0
    starts = indices(messages)
    assert all(later - earlier == 9 for earlier, later in pairwise(starts))


def test_log_is_sent_as_recorded(command: Command, bus: can.BusABC, tmp_path: Path) -> None:
    """The flags of FD frames, too."""
    log = tmp_path / "bus.LOG"
    marks = ("##1", "##0", "##3", "##2", "#")
    fd = "".join(f"(100.{n}) can0 123{mark}AABB\n" for n, mark in enumerate(marks))
    log.write_text(f"{fd}(101.5) can0 00000457#DD\n")
    command.done("replay", log, *ON_BUS, "--speed", "0")
    *of_fd, last = received(bus)
    assert {(m.arbitration_id, m.is_extended_id, bytes(m.data)) for m in of_fd} == {
        (0x123, False, b"\xaa\xbb")
    }
    assert [(m.is_fd, m.bitrate_switch, m.error_state_indicator) for m in of_fd] == [
        (True, True, False),
        (True, False, False),
        (True, True, True),
        (True, False, True),
        (False, False, False),
    ]
    assert (last.arbitration_id, last.is_extended_id, bytes(last.data)) == (0x457, True, b"\xdd")


def test_channels_of_a_log_go_onto_their_own_bus(command: Command, bus: can.BusABC, tmp_path: Path) -> None:
    log = tmp_path / "bus.log"
    log.write_text("(100.0) can0 100#00\n(100.1) can1 101#01\n(100.2) can2 102#02\n(100.3) can1 101#03\n")
    maps = ("--map-channel", "can0=elsewhere", "--map-channel", f"can1={CHANNEL}")
    with can.Bus(interface="virtual", channel="elsewhere") as other:
        command.done("replay", log, *ON_BUS, "--speed", "0", *maps)
        assert [bytes(m.data) for m in received(other)] == [b"\x00"]
    assert [bytes(m.data) for m in received(bus)] == [b"\x01", b"\x03"]
    outcome = command("replay", log, *ON_BUS, "--speed", "0")
    assert "frames of can0, can1, can2 all go onto one bus" in outcome.err


def test_what_a_log_leaves_out_is_told(command: Command, bus: can.BusABC, tmp_path: Path) -> None:
    log = tmp_path / "bus.log"
    log.write_text("(100.0) can0 100#00\n(100.1) can0 100#R\n# 12 frames lost before this\n")
    outcome = command("replay", log, *ON_BUS)
    assert "left out: 1 remote frame" in outcome.err
    assert "12 frames were lost while it was recorded" in outcome.err


def test_a_bus_where_others_send_the_same_is_refused_unless_forced(
    command: Command, bus: can.BusABC, worn: Path
) -> None:
    part = ("--start", "0.1", "--stop", "0.11", "--speed", "0")

    def while_sending(identifier: int, *arguments: str) -> Outcome:
        over = threading.Event()

        def send() -> None:
            while not over.wait(0.01):
                bus.send(can.Message(arbitration_id=identifier, is_extended_id=False, data=b"\1"))

        sender = threading.Thread(target=send)
        sender.start()
        try:
            return command("replay", worn, *ON_BUS, *part, *arguments)
        finally:
            over.set()
            sender.join()

    refused = while_sending(BLOCK.frame_id)
    assert refused.code == 2
    assert f"identifier 0x{BLOCK.frame_id:X} come in already" in refused.err
    assert not received(bus)
    assert while_sending(BLOCK.frame_id + 1).code == 0
    assert while_sending(BLOCK.frame_id, "--force").code == 0


def test_signal_ends_an_endless_replay(command: Command, worn: Path) -> None:
    with can.Bus(interface="virtual", channel=CHANNEL, fd=True) as bus:

        def stop() -> None:
            bus.recv(30.0)  # the replay runs, so its signal handlers are in place
            time.sleep(0.05)
            os.kill(os.getpid(), signal.SIGTERM)

        thread = threading.Thread(target=stop)
        thread.start()
        outcome = command("replay", worn, *ON_BUS, "--loop", "0", "--json")
        thread.join()
    assert outcome.code == 0
    assert json.loads(outcome.out)["frames"] > 0


def test_interface_that_is_not_there_is_a_failure_at_run_time(command: Command, worn: Path) -> None:
    outcome = command("replay", worn, "--channel", "can_none_here")
    assert outcome.code == 1
    assert "remedy: " in outcome.err


def test_values_the_bus_cannot_hold_are_told(command: Command, tmp_path: Path) -> None:
    path = tmp_path / "high.csv"
    header = "time_s,rail_pressure_MPa,needle_lift_mm,line_pressure_MPa\n"
    path.write_text(header + "".join(f"{k * 1e-5:.5f},400,0,100\n" for k in range(50)))
    outcome = command.done("replay", path, *ON_BUS)
    assert "warning: rail_pressure: reaches 400 MPa, beyond 317.665 MPa, the limit of" in outcome.err
