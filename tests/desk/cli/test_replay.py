"""`observer-rt replay` onto the virtual bus of this process: what arrives, and mistakes it names."""

import json
import threading
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import can
import cantools.database
import pytest

from observer_rt.config.bench import PACKAGE_DATA
from tests.desk.cli.conftest import Command, Outcome
from tests.meanwhile import meanwhile

CHANNEL = "replay-test"
ON_BUS = ("--interface", "virtual", "--channel", CHANNEL)
BLOCK = cantools.database.load_file(PACKAGE_DATA / "observer_fd.dbc").get_message_by_name("SampleBlock")


@pytest.fixture
def bus() -> Iterator[can.BusABC]:
    with can.Bus(interface="virtual", channel=CHANNEL, fd=True) as bus:
        yield bus


def received(bus: can.BusABC) -> list[can.Message]:
    return list(iter(lambda: bus.recv(0.0), None))


def test_what_is_sent_in_json(command: Command, bus: can.BusABC, worn: Path) -> None:
    outcome = command.done("replay", worn, *ON_BUS, "--speed", "10", "--windowed", "--json")
    content = json.loads(outcome.out)
    messages = received(bus)
    assert content["frames"] == len(messages) > 0
    assert content["lateness_max_s"] >= 0.0
    indices = [int(BLOCK.decode(bytes(m.data), scaling=False)["SampleIndex"]) for m in messages]
    steps = {later - earlier for earlier, later in pairwise(indices)}
    assert min(steps) == 9 < max(steps)


def test_a_channel_of_a_log_is_chosen(command: Command, bus: can.BusABC, tmp_path: Path) -> None:
    log = tmp_path / "bus.log"
    log.write_text("(100.0) can0 100#00\n(100.1) can1 101#01\n(100.2) can2 102#02\n(100.3) can1 101#03\n")
    command.done("replay", log, *ON_BUS, "--speed", "0", "--from-channel", "can1")
    assert [bytes(m.data) for m in received(bus)] == [b"\x01", b"\x03"]
    outcome = command("replay", log, *ON_BUS, "--speed", "0")
    assert "frames of can0, can1, can2 all go onto one bus" in outcome.err
    assert len(received(bus)) == 4


def test_a_bus_with_other_senders_is_refused_unless_forced(command: Command, bus: can.BusABC, worn: Path) -> None:
    def while_sending(identifier: int, *arguments: str) -> Outcome:
        def send(over: threading.Event) -> None:
            while not over.wait(0.01):
                bus.send(can.Message(arbitration_id=identifier, is_extended_id=False, data=b"\1"))

        with meanwhile(send):
            return command("replay", worn, *ON_BUS, "--speed", "0", *arguments)

    refused = while_sending(BLOCK.frame_id)
    assert refused.code == 2
    assert f"identifier 0x{BLOCK.frame_id:X} come in already" in refused.err
    assert not received(bus)
    assert while_sending(BLOCK.frame_id + 1).code == 0
    assert while_sending(BLOCK.frame_id, "--force").code == 0
