"""Three injectors on a real SocketCAN interface: the kernel gives each daemon its frames, each loop is compiled."""

import re
import signal
import subprocess
import threading
import time
from pathlib import Path

import can
import pytest

from observer_rt.bus.links.opening import open_link
from observer_rt.recording.replay.player import play
from tests.service.end_to_end import END_TIMEOUT, START_TIMEOUT, STATUS, command, decoded, wait_for
from tests.service.participants import until
from tests.three_injectors import (
    NAMES,
    RATE_ID,
    STATUS_ID,
    STEP,
    SUMMARY_ID,
    three_on,
)

SPEED = 0.03  # user-mode Linux has one processor for daemons, player and listener
LOOK_AHEAD = 100  # samples, and more, that wait for those behind them


@pytest.mark.slow
@pytest.mark.vcan
def test_each_is_observed_as_if_it_were_alone(tmp_path: Path, vcan: str) -> None:
    three = three_on(tmp_path, vcan, "socketcan")
    results = [first + number * STEP for number in range(len(NAMES)) for first in (RATE_ID, SUMMARY_ID)]
    statuses = [STATUS_ID + number * STEP for number in range(len(NAMES))]
    heard: dict[int, list[bytes]] = {identifier: [] for identifier in (*results, *statuses)}
    stop = threading.Event()
    filters: list[can.typechecking.CanFilter] = [
        {"can_id": identifier, "can_mask": 0x7FF, "extended": False} for identifier in heard
    ]

    def least_processed() -> float:
        """Samples that all injectors have been through, by what they say; -1 before all said something."""
        if not all(heard[identifier] for identifier in statuses):
            return -1.0
        return min(decoded(STATUS, heard[identifier][-1])["SamplesProcessed"] for identifier in statuses)

    def listen(bus: can.BusABC) -> None:
        while not stop.is_set():
            if (message := bus.recv(0.1)) is not None:
                heard[message.arbitration_id].append(bytes(message.data))

    with (
        can.Bus(interface="socketcan", channel=vcan, fd=True, can_filters=filters) as bus,
        open_link("socketcan", vcan, True, []) as player,
    ):
        listener = threading.Thread(target=listen, args=(bus,))
        listener.start()
        daemon = subprocess.Popen(command("run", "--bench", three.bench), stderr=subprocess.PIPE, text=True)
        try:
            wait_for(lambda: least_processed() >= 0, START_TIMEOUT, daemon)
            play(three.frames, player, SPEED)
            until(lambda: least_processed() >= three.recordings[0].samples - LOOK_AHEAD)
            daemon.send_signal(signal.SIGTERM)
            _, said = daemon.communicate(timeout=END_TIMEOUT)
            time.sleep(0.3)
        finally:
            daemon.kill()
            stop.set()
            listener.join()
    assert daemon.returncode == 0, said
    assert len(re.findall("stopped after .* 0 frames dropped, 0 results unsent", said)) == len(NAMES), said
    for number, name in enumerate(NAMES):
        for identifier, payloads in three.results_alone(number).items():
            assert heard[identifier] == payloads
        assert (tmp_path / f"learned_{name}.json").exists()
