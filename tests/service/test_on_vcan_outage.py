"""The daemon on a real SocketCAN interface that goes down, and away, in the middle of a recording."""

import math
from collections.abc import Callable
from pathlib import Path

import can
import pytest

from observer_rt.bus.links.opening import open_link
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.recording.replay.framing import TimedFrame
from observer_rt.recording.replay.player import play
from observer_rt.service.daemon import Daemon
from observer_rt.service.reports.news import Notes
from observer_rt.service.warm_up import warm_up
from tests.device import frames_of, worn_recording
from tests.interface import OwnInterface
from tests.service.end_to_end import STATUS, decoded
from tests.service.participants import bench_file, serving, until

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
    bench = load_bench(bench_file(tmp_path, name, "socketcan"))
    bus = map_bus(bench)
    warm_up(bench, bus)
    frames = frames_of(bench, worn_recording())
    inputs = [(layout.frame_id, layout.is_extended) for layout in bus.input_layouts]
    notes = Notes()
    messages = notes.messages
    with (
        open_link("socketcan", name, True, inputs) as link,
        open_link("socketcan", name, True, []) as player,
    ):
        daemon = Daemon(bench, bus, [link], listeners=[notes])

        def play_to_it(part: list[TimedFrame]) -> None:
            received = daemon.core.counters.frames + len(part)
            play(part, player, math.inf)
            until(lambda: daemon.core.counters.frames == received)

        with serving(daemon):
            until(daemon.ready.is_set)
            play_to_it(frames[:FIRST])
            outage(own_interface, lambda: until(lambda: any(said in message for message in messages)))
            until(lambda: messages[-1] == f"{name} is back")
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
