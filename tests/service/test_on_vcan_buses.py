"""The main test with a bus for each signal: replay and daemon as processes of their own, on four real interfaces."""

import contextlib
import math
from collections.abc import Iterator
from pathlib import Path

import pytest

from observer_rt.config.bench import load_bench
from observer_rt.evaluation.evaluate import evaluate
from observer_rt.recording.formats import read_recording, write_recording
from observer_rt.recording.replay.player import play
from tests.benches import block_bench
from tests.device import frames_of, worn_recording
from tests.interface import OwnInterface
from tests.service.end_to_end import output_bus, results_of, run_over
from tests.service.participants import HeardDaemon, opened, serving, until

SPEED = 0.05  # of replay: user-mode Linux has one processor for daemon, replay and listener
OTHERS = ("vcan1", "vcan2", "vcan3")


@pytest.fixture
def interfaces(vcan: str) -> Iterator[list[OwnInterface]]:
    """Further SocketCAN interfaces of this test's own, beside vcan0."""
    made = [OwnInterface(name) for name in OTHERS]
    try:
        yield made
    finally:
        for interface in made:
            with contextlib.suppress(pytest.fail.Exception):  # where the test took it away
                interface.remove()


@pytest.mark.slow
@pytest.mark.vcan
def test_results_over_four_interfaces_equal_those_of_one_bus(
    tmp_path: Path, vcan: str, interfaces: list[OwnInterface]
) -> None:
    csv = tmp_path / "worn.csv"
    write_recording(csv, worn_recording())
    recording = read_recording(csv)
    one = block_bench(tmp_path / "one", "virtual", ["one"])
    expected = evaluate(load_bench(one), [recording]).frames
    four = block_bench(tmp_path / "four", "socketcan", [vcan, *OTHERS])
    with output_bus("socketcan", OTHERS[-1]) as bus:
        heard = run_over(four, csv, bus, SPEED, recording.samples)
    if heard.last_status()["DroppedFrames"]:
        pytest.fail("machine too slow: a socket of the daemon dropped frames")
    assert heard.results == results_of(expected)
    assert len(heard.summaries) == 4
    assert heard.last_status()["TroubledBus"] == 0


@pytest.mark.vcan
def test_one_interface_of_several_goes_and_comes_back(
    tmp_path: Path, vcan: str, interfaces: list[OwnInterface]
) -> None:
    path = block_bench(tmp_path / "four", "socketcan", [vcan, *OTHERS])
    frames = frames_of(path, worn_recording())
    first, during, last = frames[:600], frames[600:780], frames[780:]
    with opened(path, sending=False) as links, opened(path, sending=True) as players:
        daemon = HeardDaemon(path, *links, is_warm=True)
        by_bus = dict(enumerate(players))
        with serving(daemon):
            until(daemon.ready.is_set)
            play(first, players[0], math.inf, by_bus=by_bus)
            until(lambda: daemon.core.counters.frames == len(first))
            interfaces[0].remove()
            until(lambda: any("there is no interface vcan1" in message for message in daemon.messages))
            others = [frame for frame in during if frame.bus != 1]
            play(others, players[0], math.inf, by_bus=by_bus)
            until(lambda: daemon.core.counters.frames == len(first) + len(others))
            interfaces[0].add()
            until(lambda: daemon.messages[-1] == "lift (vcan1) is back")
            players[1].reconnect()
            play(last, players[0], math.inf, by_bus=by_bus)
            until(lambda: daemon.core.counters.frames == len(frames) - len(during) + len(others))
    assert [port.outages for port in daemon.ports] == [0, 1, 0, 0]
    assert daemon.core.counters.lost_samples == 60 * 28
    assert daemon.dropped == 0
