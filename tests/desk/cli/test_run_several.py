"""`observer-rt run` on a bench of three injectors, on one bus with one rail pressure: a daemon for each."""

import json
import signal
from pathlib import Path

import can
import pytest

from observer_rt.bus.links.opening import open_link
from observer_rt.files.replay.player import play
from tests.daemon.end_to_end import END_TIMEOUT, START_TIMEOUT, STATUS, SUMMARY, decoded
from tests.daemon.participants import listening, until
from tests.desk.cli.bench_engineer import ended_when
from tests.desk.cli.conftest import Command, module
from tests.three_injectors import NAMES, RATE_ID, STATUS_ID, STEP, SUMMARY_ID, Three, three_injectors, three_on

Payloads = dict[int, list[bytes]]
RESULTS: list[can.typechecking.CanFilter] = [{"can_id": RATE_ID, "can_mask": 0x700, "extended": False}]
SLOWED_DOWN = 0.05  # user-mode Linux has one processor for all who take part
LOOK_AHEAD = 100  # samples, and more, that wait for those behind them


def processed(payloads: Payloads, number: int) -> float:
    statuses = payloads.get(STATUS_ID + number * STEP)
    return decoded(STATUS, statuses[-1])["SamplesProcessed"] if statuses else -1.0


def assert_as_alone(received: Payloads, three: Three, number: int) -> None:
    for identifier, payloads in three.results_alone(number).items():
        assert received[identifier] == payloads
    status = decoded(STATUS, received[STATUS_ID + number * STEP][-1])
    assert (status["InjectorId"], status["SamplesProcessed"]) == (number + 1, three.recordings[0].samples)


def test_one_is_observed_among_the_frames_of_all(command: Command, tmp_path: Path) -> None:
    three, channel = three_on(tmp_path, tmp_path.name), tmp_path.name
    samples = three.recordings[0].samples - LOOK_AHEAD
    with listening("virtual", channel, RESULTS) as listener, open_link("virtual", channel, True, []) as player:
        payloads = listener.payloads

        def first() -> None:
            until(lambda: processed(payloads, 1) == 0)
            play(three.frames, player, float("inf"))

        with ended_when(lambda: processed(payloads, 1) >= samples, first):
            outcome = command.done("run", "--bench", three.bench, "--injector", "two", "--json")
    assert_as_alone(payloads, three, 1)
    assert {identifier & 0xF0 for identifier, some in payloads.items() if some} == {STEP}
    records = [json.loads(line) for line in outcome.out.splitlines()]
    assert [(one["injector"], one["number"]) for one in records] == [("two", n) for n in (1, 2, 3, 4)]
    assert (tmp_path / "learned_two.json").exists()


@pytest.mark.slow
@pytest.mark.vcan
def test_two_daemons_on_one_bus_leave_each_other_alone(tmp_path: Path, vcan: str) -> None:
    """Processes of their own; the results of one are nothing to the other."""
    three, both = three_on(tmp_path, vcan, "socketcan"), range(2)
    samples = three.recordings[0].samples - LOOK_AHEAD
    with listening("socketcan", vcan, RESULTS) as listener, open_link("socketcan", vcan, True, []) as player:
        payloads = listener.payloads
        daemons = [module("run", "--bench", three.bench, "--injector", NAMES[number]) for number in both]
        try:
            until(lambda: all(processed(payloads, number) == 0 for number in both), START_TIMEOUT)
            play(three.frames, player, SLOWED_DOWN)
            until(lambda: all(processed(payloads, number) >= samples for number in both), END_TIMEOUT)
        finally:
            for daemon in daemons:
                daemon.send_signal(signal.SIGTERM)
            outputs = [daemon.communicate(timeout=END_TIMEOUT)[1] for daemon in daemons]
    for number, said in zip(both, outputs, strict=True):
        assert daemons[number].returncode == 0, said
        assert " 0 frames dropped, 0 results unsent, 0 frames of other senders," in said
        assert "another node" not in said
        assert_as_alone(payloads, three, number)
        summaries = [decoded(SUMMARY, payload) for payload in payloads[SUMMARY_ID + number * STEP]]
        assert [summary["Valid"] for summary in summaries] == [1, 1, 1, 1]


def test_it_must_be_said_which(command: Command, tmp_path: Path) -> None:
    bench = three_injectors(tmp_path, tmp_path.name)
    said = command.refused("run", "--bench", bench)
    assert "one, two, three" in said
    assert "--injector one" in said
    assert "observer-rt@one" in said
    assert "did you mean 'two'?" in command.refused("run", "--bench", bench, "--injector", "tow")
