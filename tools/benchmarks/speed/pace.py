"""Frames at a pace by the C sender, and when the answers came."""

import socket
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.errors import RunError
from observer_rt.foundation.units import MICROSECOND
from tests.plants.arrays import Array
from tools.benchmarks.campaign import Row
from tools.benchmarks.speed import native
from tools.benchmarks.speed.traffic import DATA_ID, RATES, SAMPLES, Ids, Traffic

LINGER = 0.3  # s after the last answer
BACKLOG = 1.8  # A frame may wait so long for room [s]: 20,000 frames, as many as a SocketCAN buffer of 16 MiB holds.


def latency_of(seconds: Array) -> Row:
    """Percentiles [us]; nan without any."""
    values = np.percentile(seconds, [50, 99, 99.9]) / MICROSECOND if seconds.size else np.full(3, np.nan)
    return dict(zip(("p50_us", "p99_us", "p999_us"), values.tolist(), strict=True))


@dataclass(frozen=True, eq=False)
class Passage:
    """Frames that were sent, and the rate frames that came back.

    first: number of the first frame; begin: index of the first sample to be reported; sent [ns]: of every frame,
    0 where it was given up; index, received [ns]: of every rate frame.
    """

    first: int
    begin: int
    sent: NDArray[np.int64]
    index: NDArray[np.int64]
    received: NDArray[np.int64]

    def latencies(self, traffic: Traffic, *, open_only: bool) -> Array:
        """Seconds from the last input frame that a rate frame needs to that rate frame."""
        number = traffic.trigger(self.index) - self.first
        answers = (number >= 0) & (number < self.sent.size)
        if open_only:  # at the last sample
            answers &= traffic.is_open[(self.index + RATES - 1) % traffic.is_open.size]
        sent = self.sent[number[answers]]
        return np.asarray((self.received[answers] - sent)[sent > 0] * 1e-9)

    def reported_until(self, traffic: Traffic) -> int:
        """Index before which every sample must be reported: nothing after it needs to be, or is."""
        sent_end = (self.first + self.sent.size) * SAMPLES
        must = sent_end - traffic.ahead - (RATES - 1)
        return max(must, int(self.index.max()) + RATES) if self.index.size else must

    def lost(self, traffic: Traffic) -> int:
        """Samples that must be reported and are in no rate frame."""
        end = self.reported_until(traffic)
        is_reported = np.zeros(max(end - self.begin, 0), np.bool_)
        for start in (self.index - self.begin).tolist():
            is_reported[max(start, 0) : max(start + RATES, 0)] = True
        return int(is_reported.size - is_reported.sum())

    @property
    def repeated(self) -> int:
        return (self.index.size - np.unique(self.index).size) * RATES

    @property
    def seconds(self) -> float:
        return float(self.received[-1] - self.sent[0]) * 1e-9 if self.received.size else float("nan")


class Pacer:
    """Sends frames to one observer; their numbers go on from one passage to the next."""

    def __init__(
        self, folder: Path, traffic: Traffic, link: str, ids: Ids, descriptors: Sequence[int] = (), first: int = 0
    ) -> None:
        """link: an interface, or `fd:N` for one of the descriptors handed over; first: number of the first frame."""
        self._program = native.program("pacer", folder)
        self._out = folder / f"passage_{ids.number}_{link.replace(':', '')}.bin"
        self._traffic, self._link, self._ids, self._descriptors = traffic, link, ids, descriptors
        self._next, self._reported_until = first, first * SAMPLES

    def send(self, count: int, period: float) -> Passage:
        """`count` frames, one every `period` [s]. Raises RunError."""
        numbers = (count, self._next, round(period * 1e9), round(LINGER * 1e3), round(BACKLOG * 1e3))
        ids = (self._ids.input, self._ids.rate, DATA_ID)
        words = [self._program, self._link, self._traffic.loop, *numbers, *ids, self._out]
        done = subprocess.run(list(map(str, words)), pass_fds=self._descriptors, check=False)
        if done.returncode:
            raise RunError(f"the sender ended with exit code {done.returncode}")
        raw = np.fromfile(self._out, np.int64)
        rates = raw[2 + count :].reshape(-1, 2)
        passage = Passage(self._next, self._reported_until, raw[2 : 2 + count], rates[:, 0], rates[:, 1])
        self._next += count
        self._reported_until = passage.reported_until(self._traffic)
        return passage


def socket_pacer(folder: Path, traffic: Traffic, end: socket.socket, first: int = 0) -> Pacer:
    return Pacer(folder, traffic, f"fd:{end.fileno()}", Ids(), [end.fileno()], first)
