"""`observer-rt run` on a bench of three injectors, on one bus with one rail pressure: each as if it were alone."""

import json
import math
import os
import signal
import sqlite3
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

import can
import pytest

from observer_rt.bus.links.link import Frame, Link
from observer_rt.bus.links.open import open_link
from observer_rt.config.bench import load_bench
from observer_rt.evaluation.evaluate import History, evaluate
from observer_rt.foundation.errors import RunError
from observer_rt.recording.replay.framing import TimedFrame
from observer_rt.recording.replay.player import play
from observer_rt.recording.signals.recording import Recording
from observer_rt.service import opening
from tests.cli.conftest import Command, Outcome
from tests.links import FakeLink
from tests.service.end_to_end import STATUS, decoded
from tests.service.participants import until
from tests.three_injectors import (
    NAMES,
    RATE_ID,
    STATUS_ID,
    STEP,
    SUMMARY_ID,
    frames_of_all,
    lift_id,
    one_alone,
    three_injectors,
    three_recordings,
)

Heard = dict[int, list[bytes]]
EVERYONE = range(len(NAMES))
RAIL_ID, SAMPLES_A_FRAME = 0x110, 28
LOOK_AHEAD = 100  # samples, and more, that wait for those behind them


@dataclass(frozen=True)
class Traffic:
    """What the devices send, and what each injector's results are by themselves."""

    recordings: list[Recording]
    frames: list[TimedFrame]
    alone: list[History]


@pytest.fixture(scope="module")
def traffic(tmp_path_factory: pytest.TempPathFactory) -> Traffic:
    folder = tmp_path_factory.mktemp("alone")
    three_injectors(folder, "alone")
    benches = [one_alone(folder, number, "alone") for number in range(len(NAMES))]
    recordings = three_recordings()
    alone = [evaluate(load_bench(path), [each]) for path, each in zip(benches, recordings, strict=True)]
    return Traffic(recordings, frames_of_all(benches, recordings), alone)


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    return three_injectors(tmp_path, tmp_path.name)


@contextmanager
def listening(channel: str) -> Iterator[Heard]:
    """Payloads on the bus by identifier."""
    heard: Heard = {}
    stop = threading.Event()
    with can.Bus(interface="virtual", channel=channel, fd=True) as bus:

        def listen() -> None:
            while not stop.is_set():
                if (message := bus.recv(0.1)) is not None:
                    heard.setdefault(message.arbitration_id, []).append(bytes(message.data))

        thread = threading.Thread(target=listen)
        thread.start()
        try:
            yield heard
        finally:
            stop.set()
            thread.join()


def processed(heard: Heard, number: int) -> float:
    """Samples of an injector, as it says; -1 before it says anything."""
    statuses = heard.get(STATUS_ID + number * STEP)
    return decoded(STATUS, statuses[-1])["SamplesProcessed"] if statuses else -1.0


def run_and_stop(
    command: Command,
    bench: Path,
    frames: Sequence[TimedFrame],
    served: Sequence[int],
    *options: object,
) -> tuple[Outcome, Heard]:
    """Play frames to the command over the virtual bus, and stop it when those `served` have seen them."""
    samples = SAMPLES_A_FRAME * sum(frame.frame_id == RAIL_ID for frame in frames) - LOOK_AHEAD
    channel = load_bench(bench).config.link.channel
    with listening(channel) as heard, open_link("virtual", channel, True, []) as player:

        def bench_engineer() -> None:
            try:
                until(lambda: all(processed(heard, number) == 0 for number in served))
                play(frames, player, math.inf)
                until(lambda: all(processed(heard, number) >= samples for number in served))
            finally:
                os.kill(os.getpid(), signal.SIGTERM)

        thread = threading.Thread(target=bench_engineer)
        thread.start()
        outcome = command("run", "--bench", bench, *options)
        thread.join()
        time.sleep(0.2)  # for the listener to hear the last frames
    return outcome, heard


def assert_as_alone(heard: Heard, traffic: Traffic, number: int) -> None:
    """Bit for bit what its own recording gives."""
    for first in (RATE_ID, SUMMARY_ID):
        identifier = first + number * STEP
        expected = [frame.payload for frame in traffic.alone[number].frames if frame.frame_id == identifier]
        assert len(expected) >= 4
        assert heard[identifier] == expected


def test_each_is_observed_as_if_it_were_alone(
    command: Command, bench: Path, traffic: Traffic, tmp_path: Path
) -> None:
    samples = traffic.recordings[0].samples

    outcome, heard = run_and_stop(command, bench, traffic.frames, EVERYONE, "--json")
    assert outcome.code == 0, outcome.err
    records = [json.loads(line) for line in outcome.out.splitlines()]
    for number, name in enumerate(NAMES):
        assert_as_alone(heard, traffic, number)
        status = decoded(STATUS, heard[STATUS_ID + number * STEP][-1])
        assert (status["InjectorId"], status["SamplesProcessed"]) == (number + 1, samples)
        assert [one["number"] for one in records if one["injector"] == name] == [1, 2, 3, 4]
        assert f"INFO injection: {name}: injection 4 at index" in outcome.err
        assert f"INFO start: {name}: ready" in outcome.err
        assert f"learned state saved in {tmp_path / f'learned_{name}.json'}" in outcome.err
        with closing(sqlite3.connect(tmp_path / f"injections_{name}.sqlite")) as journal:
            rows = journal.execute(
                "SELECT injector, count(*) FROM injection JOIN run ON run = started_unix_us"
            )
            assert rows.fetchall() == [(name, 4)]
    again, _ = run_and_stop(command, bench, (), EVERYONE)
    for name in NAMES:
        assert f"INFO kept: {name}: learned state restored" in again.err


def test_damaged_frames_of_one_leave_the_others_alone(
    command: Command, bench: Path, traffic: Traffic
) -> None:
    damaged = [
        frame._replace(payload=bytes([frame.payload[0] ^ 0xFF]) + frame.payload[1:])
        if frame.frame_id == lift_id(1)
        else frame
        for frame in traffic.frames
    ]
    outcome, heard = run_and_stop(command, bench, damaged, (0, 2))
    assert outcome.code == 0, outcome.err
    assert_as_alone(heard, traffic, 0)
    assert_as_alone(heard, traffic, 2)
    status = decoded(STATUS, heard[STATUS_ID + STEP][-1])
    assert status["CrcErrors"] > 100
    assert SUMMARY_ID + STEP not in heard


class FailingLink(FakeLink):
    """Fails for good."""

    def receive(self, timeout_s: float) -> Frame | None:
        raise RunError("the interface of two burnt down")


def test_one_that_fails_ends_alone(
    command: Command, bench: Path, traffic: Traffic, monkeypatch: pytest.MonkeyPatch
) -> None:
    def opened(interface: str, channel: str, fd: bool, wanted: list[tuple[int, bool]], stamps: bool) -> Link:
        is_failing = (lift_id(1), False) in wanted
        return FailingLink() if is_failing else open_link(interface, channel, fd, wanted, stamps)

    monkeypatch.setattr(opening, "open_link", opened)
    outcome, heard = run_and_stop(command, bench, traffic.frames, (0, 2))
    assert outcome.code == 1
    assert "WARNING stop: two: ended, the other injectors go on: the interface of two burnt" in outcome.err
    assert "error: two: the interface of two burnt down" in outcome.err
    assert_as_alone(heard, traffic, 0)
    assert_as_alone(heard, traffic, 2)


def test_when_all_have_failed_it_ends(command: Command, bench: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(opening, "open_link", lambda *_: FailingLink())
    outcome = command("run", "--bench", bench)
    assert outcome.code == 1
    assert all(f"{name}: the interface" in outcome.err for name in NAMES)


def test_one_of_them_can_be_run_by_itself(command: Command, bench: Path, traffic: Traffic) -> None:
    outcome = command("run", "--bench", bench, "--injector", "tow")
    assert outcome.code == 2
    assert "did you mean 'two'?" in outcome.err


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (f"id_step = {STEP}\n", "", "have one the message InjectionRate 0x300"),
        ("learned_{injector}.json", "learned.json", "have one state.file ="),
        ("injections_{injector}.sqlite", "injections.sqlite", "have one state.journal ="),
        ("[sampling]", "[outputs_]", "did you mean 'outputs'?"),
        ('"virtual"', '"pcan"', "'pcan' can be opened once only, but one and two and three use"),
    ],
)
def test_what_they_cannot_share(command: Command, bench: Path, old: str, new: str, said: str) -> None:
    text = bench.read_text()
    assert old in text
    bench.write_text(text.replace(old, new))
    outcome = command("run", "--bench", bench)
    assert outcome.code == 2
    assert said in outcome.err


@pytest.mark.parametrize(("option", "key"), [("--state", "file"), ("--journal", "journal")])
def test_a_file_for_all_is_refused(command: Command, bench: Path, option: str, key: str) -> None:
    outcome = command("run", "--bench", bench, option, "kept.json")
    assert outcome.code == 2
    assert "is one file for 3 injectors: one, two, three" in outcome.err
    assert f'[state] {key} = "kept_{{injector}}.json"' in outcome.err
