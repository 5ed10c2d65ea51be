"""`tools/bench speed`: what a windowed sender sends, and the counts of one injector and of several."""

import socket
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.core.frames.frames import SUPERVISION, status_of_frame
from tests.observed_plants import bench_at
from tools.benchmarks.speed.injectors import in_windows, lost, sent_frames
from tools.benchmarks.speed.pace import Pacer, Passage
from tools.benchmarks.speed.traffic import RATES, RAW_FRAME, SAMPLE_RATE, SAMPLES, Ids, Traffic, index_of

WRONG = {4, 5}  # E2E_CRC_ERROR, E2E_LENGTH_ERROR


def test_pauses_have_their_time_and_are_not_sent(folder: Path, traffic: Traffic) -> None:
    """Frames of a windowed source: the index goes on over a pause, the counter does not."""
    windowed = in_windows(traffic)
    is_sent = sent_frames(windowed)
    is_open = traffic.is_open.reshape(-1, SAMPLES).any(axis=1)
    assert is_sent[is_open].all()
    assert 0.15 < is_sent.mean() < 0.25  # 2 ms before, 4 ms after an open needle every 40 ms
    count, first = 1000, traffic.frames + 300
    numbers = first + np.flatnonzero(is_sent[(first + np.arange(count)) % is_sent.size])
    before = is_sent.sum() + is_sent[:300].sum()
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours, theirs:
        link, descriptor = f"fd:{theirs.fileno()}", theirs.fileno()
        with ThreadPoolExecutor(1) as executor:
            sending = executor.submit(
                lambda: Pacer(folder, windowed, link, Ids(), [descriptor], first).send(count, 20e-6)
            )
            raw = b"".join(ours.recv(100) for _ in numbers)
            passage = sending.result()
    frames, message = np.frombuffer(raw, RAW_FRAME)["data"], map_bus(bench_at(SAMPLE_RATE)).inputs.messages[0]
    assert not {status_of_frame(each, message, np.zeros(1, SUPERVISION)) for each in frames} & WRONG
    assert [index_of(payload.tobytes()) for payload in frames] == (numbers * SAMPLES).tolist()
    loop = np.frombuffer(traffic.loop.read_bytes(), RAW_FRAME)["data"]
    np.testing.assert_array_equal(frames[:, 8:], loop[numbers % traffic.frames, 8:])
    assert [int(payload[2]) for payload in frames] == [(before + n) % 256 for n in range(len(numbers))]
    assert np.array_equal(first + np.flatnonzero(passage.sent), numbers)


def test_what_injectors_lost_is_counted_window_by_window(traffic: Traffic) -> None:
    is_sent = np.zeros(40, np.bool_)
    is_sent[10:20] = True  # of 40 frames, a window of 90 samples
    ends = np.array([0, 28, 56, 84])
    indices = np.concatenate([window * 360 + 90 + ends for window in range(3)])

    def passages(index: NDArray[np.int64]) -> list[Passage]:
        sent, stamps = np.ones(60, np.int64), np.zeros(index.size, np.int64)
        return [Passage(0, 0, sent, index[:5], stamps[:5]), Passage(60, 0, sent, index[5:], stamps[5:])]

    assert lost(passages(indices), is_sent) == 0
    assert lost(passages(indices[:-2]), is_sent) == 0  # of the last window
    assert lost(passages(np.delete(indices, 1)), is_sent) == RATES
    assert lost(passages(np.delete(indices, 3)), is_sent) == 90 - 84
    assert lost(passages(np.delete(indices, range(4, 12))), is_sent) == 90


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
