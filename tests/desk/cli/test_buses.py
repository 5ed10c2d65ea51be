"""Several buses from the command line: recorded into one log, evaluated, converted and replayed from it."""

import threading
import uuid
from collections.abc import Iterator
from pathlib import Path

import can
import pytest

from observer_rt.bus.links.opening import open_link
from observer_rt.files.formats import open_log
from tests.benches import block_bench, twin_bench
from tests.daemon.participants import until
from tests.desk.cli.conftest import Command, document
from tests.device import candump_lines, frames_of, later, worn_recording
from tests.meanwhile import meanwhile

CHANNELS = ("can0", "can1", "can2", "can3")


def log_of(bench: Path, path: Path) -> int:
    """The frames of a recording as `candump` would have logged them; their number."""
    frames = frames_of(bench, worn_recording())
    path.write_text("".join(candump_lines(later(frames, 100.0), CHANNELS)))
    return len(frames)


@pytest.fixture(scope="module")
def twins(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return twin_bench(tmp_path_factory.mktemp("twins"))


def masses(command: Command, *arguments: object) -> list[float]:
    (recording,) = document(command, *arguments)["recordings"]
    return [injection["mass_mg"] for injection in recording["injections"]]


def test_a_log_of_three_buses_is_as_the_recording(command: Command, twins: Path, tmp_path: Path) -> None:
    log = tmp_path / "bus.log"
    log_of(twins, log)
    result = masses(command, log, "--bench", twins)
    assert len(result) == 4
    numbered = tmp_path / "bus.blf"
    command.done("convert", log, numbered)
    assert {entry.channel for entry in open_log(numbered)} == {"1", "2", "3"}
    assert masses(command, numbered, "--bench", twins) == result
    csv = tmp_path / "bus.csv"
    outcome = command.done("convert", numbered, csv, "--bench", twins)
    assert "channel 1 is can0, 2 is lift (can1), 3 is line (can2)" in " ".join(outcome.err.split())
    assert masses(command, csv, "--bench", twins) == pytest.approx(result, rel=1e-9)


@pytest.fixture
def channels() -> list[str]:
    return [f"{uuid.uuid4().hex[:8]}-{number}" for number in range(4)]


@pytest.fixture
def ears(channels: list[str]) -> Iterator[list[can.BusABC]]:
    buses: list[can.BusABC] = [can.Bus(interface="virtual", channel=name) for name in channels]
    try:
        yield buses
    finally:
        for bus in buses:
            bus.shutdown()


def received(bus: can.BusABC) -> list[bytes]:
    return [bytes(message.data) for message in iter(lambda: bus.recv(0.0), None)]


def test_replay_sends_every_message_on_its_bus(
    command: Command, channels: list[str], ears: list[can.BusABC], tmp_path: Path, worn: Path
) -> None:
    bench = block_bench(tmp_path, "virtual", CHANNELS)
    said = [
        word
        for name, channel in zip(("", "lift=", "line=", "results="), channels, strict=True)
        for word in ("--channel", f"{name}{channel}")
    ]
    arguments = ("--bench", bench, *said, "--speed", "0")
    command.done("replay", worn, *arguments)
    sent = [received(bus) for bus in ears]
    frames = frames_of(bench, worn_recording())
    assert [len(each) for each in sent] == [sum(f.bus == bus for f in frames) for bus in range(4)]
    log = tmp_path / "bus.log"
    log_of(bench, log)
    assert "--from-channel lift=CHANNEL" in command.refused("replay", log, *arguments)
    routes = ("can0", "lift=can1", "line=can2")
    command.done("replay", log, *arguments, *(word for each in routes for word in ("--from-channel", each)))
    assert [received(bus) for bus in ears] == sent


def test_all_buses_are_recorded_into_one_log(command: Command, channels: list[str], tmp_path: Path) -> None:
    bench = block_bench(tmp_path, "virtual", channels)
    path = tmp_path / "bus.log"
    sent = frames_of(bench, worn_recording())[:300]

    def send(_: threading.Event) -> None:
        until(lambda: threading.active_count() >= before + 1 + len(channels))
        links = [open_link("virtual", name, True, []) for name in channels]
        for frame in sent:
            links[frame.bus].send(frame.frame_id, frame.payload, False, True)
        for link in links:
            link.close()

    before = threading.active_count()
    with meanwhile(send):
        outcome = command("record", "--bench", bench, "--out", path, "--frames", len(sent))
    assert outcome.code == 0, outcome.err
    for bus, channel in enumerate(channels):
        recorded = [entry.frame.payload for entry in open_log(path) if entry.channel == channel]
        assert recorded == [frame.payload for frame in sent if frame.bus == bus]
