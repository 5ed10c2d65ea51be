"""`observer-rt run` on a bench of three injectors, on one bus with one rail pressure: each as if it were alone."""

import json
import math
import sqlite3
import threading
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

import can
import pytest

from observer_rt.bus.links.link import Frame, Link, LinkDownError
from observer_rt.bus.links.opening import open_link
from observer_rt.config.bench import load_bench
from observer_rt.config.bench_file import LinkConfig
from observer_rt.daemon import link_opening
from observer_rt.files.replay.framing import TimedFrame
from observer_rt.files.replay.player import play
from observer_rt.foundation.errors import ObserverError, RunError, UserError
from tests.daemon.end_to_end import START_TIMEOUT, STATUS, decoded
from tests.daemon.participants import until
from tests.desk.cli.bench_engineer import ended_when
from tests.desk.cli.conftest import Command, Outcome
from tests.links import FakeLink
from tests.three_injectors import (
    NAMES,
    RATE_ID,
    STATUS_ID,
    STEP,
    SUMMARY_ID,
    lift_id,
    three_injectors,
    three_on,
)

Heard = dict[int, list[bytes]]
EVERYONE = range(len(NAMES))
RAIL_ID, SAMPLES_A_FRAME = 0x110, 28
LOOK_AHEAD = 100  # samples, and more, that wait for those behind them
RESULTS: list[can.typechecking.CanFilter] = [{"can_id": RATE_ID, "can_mask": 0x700, "extended": False}]
SPEED = {"virtual": math.inf, "socketcan": 0.03}  # user-mode Linux has one processor for all who take part


@dataclass(frozen=True)
class Traffic:
    """What the devices send: frames of so many samples. alone: the results of each injector by itself."""

    samples: int
    frames: list[TimedFrame]
    alone: list[Heard]


@pytest.fixture(scope="module")
def traffic(tmp_path_factory: pytest.TempPathFactory) -> Traffic:
    three = three_on(tmp_path_factory.mktemp("alone"), "alone")
    return Traffic(three.recordings[0].samples, three.frames, [three.results_alone(n) for n in EVERYONE])


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    return three_injectors(tmp_path, tmp_path.name)


@contextmanager
def listening(link: LinkConfig) -> Iterator[Heard]:
    """Payloads of results on the bus by identifier."""
    heard: Heard = {}
    stop = threading.Event()
    with can.Bus(interface=link.interface, channel=link.channel, fd=True, can_filters=RESULTS) as bus:

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
    command: Command, bench: Path, frames: Sequence[TimedFrame], served: Sequence[int], *options: object
) -> tuple[Outcome, Heard]:
    """Play frames to the command over the bus, and stop it when those `served` have seen them."""
    samples = SAMPLES_A_FRAME * sum(frame.frame_id == RAIL_ID for frame in frames) - LOOK_AHEAD
    link = load_bench(bench).config.link
    with listening(link) as heard, open_link(link.interface, link.channel, True, []) as player:

        def first() -> None:
            until(lambda: all(processed(heard, number) == 0 for number in served), START_TIMEOUT)
            play(frames, player, SPEED[link.interface])

        with ended_when(lambda: all(processed(heard, number) >= samples for number in served), first):
            outcome = command("run", "--bench", bench, *options)
        time.sleep(0.2)  # for the listener to hear the last frames
    return outcome, heard


def assert_as_alone(heard: Heard, traffic: Traffic, number: int) -> None:
    """Bit for bit what its own recording gives."""
    for identifier, payloads in traffic.alone[number].items():
        assert heard[identifier] == payloads


@pytest.mark.parametrize(
    "interface", ["virtual", pytest.param("socketcan", marks=[pytest.mark.slow, pytest.mark.vcan])]
)
def test_each_is_observed_as_if_it_were_alone(
    request: pytest.FixtureRequest, command: Command, traffic: Traffic, tmp_path: Path, interface: str
) -> None:
    """The kernel of a real interface gives each daemon its frames, and each loop is compiled."""
    channel = tmp_path.name if interface == "virtual" else request.getfixturevalue("vcan")
    bench = three_injectors(tmp_path, channel, interface)
    outcome, heard = run_and_stop(command, bench, traffic.frames, EVERYONE, "--json")
    assert outcome.code == 0, outcome.err
    assert outcome.err.count(" 0 frames dropped, 0 results unsent") == len(NAMES), outcome.err
    records = [json.loads(line) for line in outcome.out.splitlines()]
    for number, name in enumerate(NAMES):
        assert_as_alone(heard, traffic, number)
        status = decoded(STATUS, heard[STATUS_ID + number * STEP][-1])
        assert (status["InjectorId"], status["SamplesProcessed"]) == (number + 1, traffic.samples)
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


def test_on_an_interface_that_opens_once_they_share_the_connection(
    command: Command, bench: Path, traffic: Traffic, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As those of vendors; it is opened with what all of them want."""
    opened: list[tuple[int, bool]] = []

    def connect(interface: str, channel: str, fd: bool, wanted: list[tuple[int, bool]], stamps: bool) -> Link:
        opened.extend(wanted)
        return open_link(interface, channel, fd, wanted, stamps)

    monkeypatch.setattr(link_opening, "open_link", connect)
    monkeypatch.setattr("observer_rt.daemon.link_opening.OPENED_OFTEN", ())
    outcome, heard = run_and_stop(command, bench, traffic.frames, EVERYONE)
    assert outcome.code == 0, outcome.err
    for number in EVERYONE:
        assert_as_alone(heard, traffic, number)
        assert opened.count((lift_id(number), False)) == opened.count((RAIL_ID, False)) <= 2
    assert "another node" not in outcome.err


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

    def __init__(self, failure: ObserverError | None = None) -> None:
        super().__init__()
        self._failure = failure or RunError("the interface of two burnt down")

    def receive(self, timeout_s: float) -> Frame | None:
        raise self._failure


def test_one_that_fails_ends_alone(
    command: Command, bench: Path, traffic: Traffic, monkeypatch: pytest.MonkeyPatch
) -> None:
    def opened(interface: str, channel: str, fd: bool, wanted: list[tuple[int, bool]], stamps: bool) -> Link:
        is_failing = (lift_id(1), False) in wanted
        return FailingLink() if is_failing else open_link(interface, channel, fd, wanted, stamps)

    monkeypatch.setattr(link_opening, "open_link", opened)
    outcome, heard = run_and_stop(command, bench, traffic.frames, (0, 2))
    assert outcome.code == 1
    assert "WARNING stop: two: ended, the other injectors go on: the interface of two burnt" in outcome.err
    assert "error: two: the interface of two burnt down" in outcome.err
    assert_as_alone(heard, traffic, 0)
    assert_as_alone(heard, traffic, 2)


def test_when_all_have_failed_it_ends(command: Command, bench: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link_opening, "open_link", lambda *_: FailingLink())
    outcome = command("run", "--bench", bench)
    assert outcome.code == 1
    assert all(f"{name}: the interface" in outcome.err for name in NAMES)


MISTAKE = UserError("link.interface", "unknown interface 'socketcna'", "use socketcan")


@pytest.mark.parametrize(("of_two", "code"), [(MISTAKE, 2), (RunError("burnt down"), 1)])
def test_a_mistake_of_the_user_is_one_for_several_as_well(
    command: Command, bench: Path, monkeypatch: pytest.MonkeyPatch, of_two: ObserverError, code: int
) -> None:
    def opened(_i: str, _c: str, _f: bool, wanted: list[tuple[int, bool]], _s: bool) -> Link:
        if (lift_id(1), False) in wanted:
            raise of_two
        if (RAIL_ID, False) in wanted:
            raise MISTAKE
        return FakeLink()

    monkeypatch.setattr(link_opening, "open_link", opened)
    outcome = command("run", "--bench", bench)
    assert outcome.code == code
    for name, failure in zip(NAMES, (MISTAKE, of_two, MISTAKE), strict=True):
        assert f"{name}: {str(failure).splitlines()[0]}" in outcome.err


class AwayOnceLink(FakeLink):
    """Goes away when it is first read, and comes back."""

    def __init__(self) -> None:
        super().__init__()
        self.was_away = False

    def receive(self, timeout_s: float) -> Frame | None:
        time.sleep(timeout_s)
        if not self.was_away:
            self.was_away = True
            raise LinkDownError("can0 went away")
        return None


def test_what_is_wrong_with_their_bus_is_said_once(
    command: Command, bench: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Their interface is not there at first, and goes away later."""
    tries: Counter[str] = Counter()
    links: list[AwayOnceLink] = []

    def opened(_i: str, _c: str, _f: bool, wanted: list[tuple[int, bool]], _s: bool) -> Link:
        tries[str(wanted)] += 1
        if (RAIL_ID, False) in wanted:
            links.append(AwayOnceLink())
            return links[-1]
        if tries[str(wanted)] < 3:
            raise LinkDownError("can0 is down\n  remedy: raise it")
        return FakeLink()

    monkeypatch.setattr(link_opening, "open_link", opened)
    with ended_when(lambda: len(links) == len(NAMES) and all(link.was_away and link.sent for link in links)):
        outcome = command.done("run", "--bench", bench)
    channel = load_bench(bench).config.link.channel
    for line in (
        "WARNING link: waiting for the interface: can0 is down",
        f"INFO link: {channel} is there",
        "INFO start: time stamps: arrival",
        "WARNING link: waiting for the interface: can0 went away",
        f"INFO link: {channel} is back",
    ):
        assert outcome.err.count(line) == 1, outcome.err
    assert "one: waiting" not in outcome.err


def test_one_of_them_can_be_run_by_itself(command: Command, bench: Path, traffic: Traffic) -> None:
    assert "did you mean 'two'?" in command.refused("run", "--bench", bench, "--injector", "tow")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (f"id_step = {STEP}\n", "", "share the message InjectionRate 0x300"),
        ("learned_{injector}.json", "learned.json", "share state.file ="),
        ("injections_{injector}.sqlite", "injections.sqlite", "share state.journal ="),
        ("[sampling]", "[outputs_]", "did you mean 'outputs'?"),
    ],
)
def test_what_they_cannot_share(command: Command, bench: Path, old: str, new: str, said: str) -> None:
    text = bench.read_text()
    assert old in text
    bench.write_text(text.replace(old, new))
    assert said in command.refused("run", "--bench", bench)


@pytest.mark.parametrize(("option", "key"), [("--state", "file"), ("--journal", "journal")])
def test_a_file_for_all_is_refused(command: Command, bench: Path, option: str, key: str) -> None:
    said = command.refused("run", "--bench", bench, option, "kept.json")
    assert "is one file for 3 injectors: one, two, three" in said
    assert f'[state] {key} = "kept_{{injector}}.json"' in said
