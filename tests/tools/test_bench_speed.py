"""`tools/bench speed`: its peers compute what ours computes, its sender sends what it should, its counts count."""

import socket
import subprocess
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.core.frames.frames import SUPERVISION, status_of_frame
from tests.observed_plants import bench_at
from tools.benchmarks.speed import native
from tools.benchmarks.speed.pace import Passage
from tools.benchmarks.speed.traffic import DATA_ID, RATE_ID, RATES, RAW_FRAME, SAMPLE_RATE, SAMPLES, Traffic, index_of

WRONG = (4, 5)  # E2E_CRC_ERROR, E2E_LENGTH_ERROR


def test_sender_goes_on_with_index_counter_and_crc(folder: Path, traffic: Traffic) -> None:
    count = 300
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours, theirs:
        number = theirs.fileno()
        first = traffic.frames - 20  # over the end of the loop
        program, out = native.program("pacer", folder), folder / "sent.bin"
        numbers = (count, first, 20_000, 50, 1000, 0x123, RATE_ID, DATA_ID)
        words = [program, f"fd:{number}", traffic.loop, *numbers, out]
        with subprocess.Popen(list(map(str, words)), pass_fds=[number]) as sender:
            raw = b"".join(ours.recv(100) for _ in range(count))
        assert sender.returncode == 0
    frames, loop = np.frombuffer(raw, RAW_FRAME), np.frombuffer(traffic.loop.read_bytes(), RAW_FRAME)
    assert set(frames["id"].tolist()) == {0x123}
    assert frames["data"][:20].tobytes() == loop["data"][-20:].tobytes()  # as the framer wrote them
    message = map_bus(bench_at(SAMPLE_RATE)).inputs.messages[0]
    for number, payload in enumerate(frames["data"]):
        assert status_of_frame(payload, message, np.zeros(1, SUPERVISION)) not in WRONG
        assert payload[2] == (first + number) % 256
        assert index_of(payload.tobytes()) == (first + number) * SAMPLES
        assert payload[8:].tobytes() == loop["data"][(first + number) % traffic.frames][8:].tobytes()


def test_latency_counts_from_the_frame_that_was_needed(traffic: Traffic) -> None:
    sent = 1000 + 90_000 * np.arange(20)
    index = np.array([28, 56])
    trigger = (index + 27 + traffic.ahead) // 9 - 3
    passage = Passage(3, 27, sent, index, sent[trigger] + 50_000)
    np.testing.assert_allclose(passage.latencies(traffic, open_only=False), 50e-6)


def test_what_is_missing_is_lost_and_what_is_given_up_has_no_latency(traffic: Traffic) -> None:
    sent = 1000 + 90_000 * np.arange(28)  # nine blocks, but what is known ahead of the last
    index = np.arange(0, 8 * RATES, RATES)

    def passage(index: NDArray[np.int64], begin: int = 0, sent: NDArray[np.int64] = sent) -> Passage:
        return Passage(0, begin, sent, index, np.full(index.size, 10_000_000))

    assert passage(index).lost(traffic) == 0
    assert passage(index[1:]).lost(traffic) == RATES
    assert passage(index[:-1]).lost(traffic) == 28 * SAMPLES - traffic.ahead - 27 - 7 * RATES
    assert passage(np.delete(index, 3)).lost(traffic) == RATES
    shifted = np.append(index[:4], 5 + index[4:])  # begun anew after a gap
    assert passage(shifted).lost(traffic) == 5
    assert passage(index[1:], begin=RATES).lost(traffic) == 0
    assert passage(np.append(index, 28)).repeated == RATES
    given_up = sent.copy()
    given_up[traffic.trigger(index[:1])] = 0
    assert passage(index, sent=given_up).latencies(traffic, open_only=False).size == 7
