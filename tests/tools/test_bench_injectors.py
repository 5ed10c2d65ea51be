"""`tools/bench speed --only injectors`: what a windowed sender sends, and the counts of several injectors."""

import socket
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tools.benchmarks.speed.injectors import in_windows, lost, sent_frames
from tools.benchmarks.speed.pace import Pacer, Passage
from tools.benchmarks.speed.traffic import RATES, RAW_FRAME, SAMPLES, Ids, Traffic, index_of


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
    frames = np.frombuffer(raw, RAW_FRAME)["data"]
    assert [index_of(payload.tobytes()) for payload in frames] == (numbers * SAMPLES).tolist()
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
