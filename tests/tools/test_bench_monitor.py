"""`tools/bench monitor`: its bus carries every frame, gaps are those between frames, a real page is measured."""

import json
import socket
from pathlib import Path

import numpy as np
import pytest

from tests.tools.test_bench_accuracy import bench
from tools.benchmarks.live_page.measure import RATE_PANEL, socket_buses
from tools.benchmarks.live_page.watched import Gaps
from tools.benchmarks.speed.traffic import RAW_FRAME

FRAMES = 3000  # more than sockets usually hold
ROOM = 20_000  # of the hub, for each
SENT = 3 * ROOM


def frame(number: int) -> bytes:
    raw = np.zeros(1, RAW_FRAME)
    raw["id"] = number
    return raw.tobytes()


def numbers_at(seat: socket.socket, count: int) -> list[int]:
    seat.settimeout(10.0)
    return [int(np.frombuffer(seat.recv(72), RAW_FRAME)["id"][0]) for _ in range(count)]


def test_a_frame_reaches_all_others_of_its_bus_and_nobody_else(tmp_path: Path) -> None:
    with socket_buses(tmp_path, 2) as ((one, other), hub):
        for number in range(FRAMES):
            one.devices.send(frame(number))
        assert numbers_at(one.listener, FRAMES) == numbers_at(one.daemon, FRAMES) == [*range(FRAMES)]
        one.daemon.send(frame(FRAMES))
        assert numbers_at(one.listener, 1) == numbers_at(one.devices, 1) == [FRAMES]
        assert hub.lost_to_listeners() == 0
        other.devices.send(frame(7))
        assert numbers_at(other.listener, 1) == [7]


def test_a_listener_that_sleeps_loses_frames_which_are_counted(tmp_path: Path) -> None:
    with socket_buses(tmp_path, 1) as ((bus,), hub):
        for number in range(SENT):
            bus.devices.send(frame(number))
        assert numbers_at(bus.daemon, ROOM) == [*range(ROOM)]
        assert 0 < hub.lost_to_listeners() <= SENT - ROOM


def test_gaps_count_from_begin_to_end() -> None:
    gaps = Gaps.of(np.array([0.0, 90.0, 110.0, 120.0, 150.0, 300.0]), 100.0, 200.0)
    assert (gaps.longest, gaps.median, gaps.per_second) == (50.0, 20.0, 30.0)


@pytest.mark.slow
def test_both_pages_are_watched() -> None:
    """In a process of its own, as its user has it. Whether it is smooth is not told beside other tests."""
    done = bench("monitor", "--seconds", "2", "--json")
    assert done.returncode in (0, 1), done.stderr
    found = json.loads(done.stdout[done.stdout.index("{") :])
    assert found["figures"]["longest_gap_ms"] > 0.0
    assert found["figures"]["browser_cpu"] > 0.0
    assert set(found["details"]["ours"]["drawn"]) >= {RATE_PANEL, "line_pressure", "mass", "wear"}
    assert found["details"]["bare"]["drawn"]["line"]["per_second"] > 0.0
