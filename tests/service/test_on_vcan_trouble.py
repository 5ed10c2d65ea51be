"""The daemon on a real SocketCAN interface that carries less than is sent, or goes down, and away, in the middle."""

import math
from collections.abc import Callable
from pathlib import Path

import can
import pytest

from observer_rt.config.bench import load_bench
from observer_rt.evaluation.evaluate import evaluate
from observer_rt.recording.replay.framing import TimedFrame
from observer_rt.recording.replay.player import play
from tests.device import frames_of, worn_recording
from tests.interface import FRAME_BYTES, OwnInterface
from tests.service.end_to_end import STATUS, decoded, results_of
from tests.service.participants import HeardDaemon, bench_file, opened, over_bus, serving, until

BUS = 1000  # frames/s: fewer than the slowest machine sends
QUEUE = 20  # frames


@pytest.mark.vcan
def test_inputs_and_results_wait_for_one_full_queue(own_interface: OwnInterface, tmp_path: Path) -> None:
    """Replay sends as fast as it may: it and the daemon find the queue full, and share what leaves it."""
    own_interface.slow_down(BUS * FRAME_BYTES, QUEUE * FRAME_BYTES)
    path = bench_file(tmp_path, own_interface.name, "socketcan")
    recording = worn_recording(2)
    expected = evaluate(load_bench(path), [recording]).frames
    heard, daemon = over_bus(path, frames_of(path, recording))
    assert own_interface.refused > 0
    assert (daemon.unsent, daemon.dropped, daemon.core.counters.lost_samples) == (0, 0, 0)
    assert heard.results == results_of(expected)
    assert len(heard.summaries) == 2


BLOCK = 9  # samples of a SampleBlock
FIRST, LOST, LAST = 600, 200, 600  # frames before, during and after the outage


def taken_down(interface: OwnInterface, until_noticed: Callable[[], None]) -> None:
    interface.down()
    until_noticed()
    interface.up()


def unplugged(interface: OwnInterface, until_noticed: Callable[[], None]) -> None:
    interface.remove()
    until_noticed()
    interface.add()


@pytest.mark.slow
@pytest.mark.vcan
@pytest.mark.parametrize(
    ("outage", "said"), [(taken_down, "vcan9 is down"), (unplugged, "there is no interface vcan9")]
)
def test_the_daemon_stays_and_goes_on(
    own_interface: OwnInterface,
    tmp_path: Path,
    outage: Callable[[OwnInterface, Callable[[], None]], None],
    said: str,
) -> None:
    name = own_interface.name
    path = bench_file(tmp_path, name, "socketcan")
    frames = frames_of(path, worn_recording())
    with opened(path, sending=False) as [link], opened(path, sending=True) as [player]:
        daemon = HeardDaemon(path, link, is_warm=True)

        def play_to_it(part: list[TimedFrame]) -> None:
            received = daemon.core.counters.frames + len(part)
            play(part, player, math.inf)
            until(lambda: daemon.core.counters.frames == received)

        with serving(daemon):
            until(daemon.ready.is_set)
            play_to_it(frames[:FIRST])
            outage(own_interface, lambda: until(lambda: any(said in message for message in daemon.messages)))
            until(lambda: daemon.messages[-1] == f"{name} is back")
            with can.Bus(interface="socketcan", channel=name, fd=True) as listener:
                player.reconnect()
                play_to_it(frames[FIRST + LOST : FIRST + LOST + LAST])
                listener.set_filters([{"can_id": STATUS.frame_id, "can_mask": 0x7FF}])
                status = None
                while status is None or status["SamplesProcessed"] < (FIRST + LAST - 1) * BLOCK:
                    message = listener.recv(5.0)
                    assert message is not None
                    if message.arbitration_id == STATUS.frame_id:
                        status = decoded(STATUS, bytes(message.data))
    assert status["LinkTroubles"] == 1
    assert status["LostSamples"] == LOST * BLOCK
    assert status["DroppedFrames"] == 0
