"""Several injectors, each with a daemon that learns and a bus of its own: windows at 100 kHz, 25 a second."""

import json
import re
import socket
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.stream.state import Reason
from observer_rt.foundation.errors import RunError
from observer_rt.foundation.units import MILLISECOND
from tools.benchmarks.campaign import Row
from tools.benchmarks.speed.observers import RUN, observer
from tools.benchmarks.speed.pace import Passage, socket_pacer
from tools.benchmarks.speed.sustained import socket_pair
from tools.benchmarks.speed.traffic import PERIOD, RATES, RAW_FRAME, SAMPLE_RATE, SAMPLES, Ids, Traffic, write_bench

NUMBERS = (1, 2, 4, 8)
BEFORE, AFTER = 2 * MILLISECOND, 4 * MILLISECOND  # of an open needle, as a windowed source sends them
_FRAME = SAMPLES / SAMPLE_RATE  # s
_SETTLING = 2.0  # s
_LAST_WORDS = re.compile(r"stopped after \d+ samples, (\d+) injections; .* (\d+) late, (\d+) events not learned from")


def measure_injectors(folder: Path, traffic: Traffic, seconds: float) -> list[Row]:
    """Send windows to the daemons of each number of injectors for `seconds`. Raises RunError."""
    windowed = in_windows(traffic)
    return [_row(folder, windowed, number, seconds) for number in NUMBERS]


def in_windows(traffic: Traffic) -> Traffic:
    """The traffic with pauses in place of the frames far from an open needle, as a windowed source sends it."""
    before, after = (round(each * SAMPLE_RATE) for each in (BEFORE, AFTER))
    round_and_round = np.tile(traffic.is_open, 3)
    spread = np.convolve(round_and_round, np.ones(before + after + 1))[before : before + round_and_round.size]
    near = np.split(spread > 0.5, 3)[1]
    raw = np.frombuffer(traffic.loop.read_bytes(), RAW_FRAME).copy()
    raw["length"][~near.reshape(-1, SAMPLES).any(axis=1)] = 0
    loop = traffic.loop.with_suffix(".windows")
    loop.write_bytes(raw.tobytes())
    return replace(traffic, loop=loop)


def sent_frames(traffic: Traffic) -> NDArray[np.bool_]:
    return np.asarray(np.frombuffer(traffic.loop.read_bytes(), RAW_FRAME)["length"] > 0)


def lost(passages: Sequence[Passage], is_sent: NDArray[np.bool_]) -> int:
    """Number of samples that were sent and came back in no rate frame; the last window may still wait."""
    numbers = np.concatenate([each.first + np.arange(each.sent.size) for each in passages])
    numbers = numbers[is_sent[numbers % is_sent.size]]
    begins = np.flatnonzero(np.diff(numbers, prepend=-2) > 1)  # of windows
    due = np.flatnonzero(_marked(SAMPLES * numbers[: begins[-1]], SAMPLES))
    reported = _marked(np.concatenate([each.index for each in passages]), RATES)
    return int(due.size - np.count_nonzero(reported[due[due < reported.size]]))


def _marked(starts: NDArray[np.int64], length: int) -> NDArray[np.bool_]:
    """Mask of the samples in runs of `length` from each start."""
    marked = np.zeros(int(starts.max(initial=0)) + length, np.bool_)
    for offset in range(length):
        marked[starts + offset] = True
    return marked


def _row(folder: Path, traffic: Traffic, number: int, seconds: float) -> Row:
    with ExitStack() as stack:
        pairs = [socket_pair(stack) for _ in range(number)]
        bench = socket_bench(folder / f"injectors_{number}", [receiver for _, receiver in pairs])
        ours = [
            stack.enter_context(observer([*RUN, bench, "--injector", f"i{n}", "--json"], [receiver.fileno()]))
            for n, (_, receiver) in enumerate(pairs)
        ]
        turns = [round(place * PERIOD / number / _FRAME) for place in range(number)]  # they inject in turn
        senders = zip(turns, pairs, strict=True)
        pacers = [socket_pacer(folder, traffic, sender, turn) for turn, (sender, _) in senders]
        together = stack.enter_context(ThreadPoolExecutor(number))

        def sent(duration: float) -> list[Passage]:
            return list(together.map(lambda pacer: pacer.send(round(duration / _FRAME), _FRAME), pacers))

        settling = sent(_SETTLING)
        before, begin = sum(each.cpu_time() for each in ours), time.monotonic()
        passages = sent(seconds)
        share = (sum(each.cpu_time() for each in ours) - before) / (time.monotonic() - begin)
    is_sent = sent_frames(traffic)
    missing = sum(lost(both, is_sent) for both in zip(settling, passages, strict=True))
    return counted(number, share, missing, [line for each in ours for line in each.said])


def counted(number: int, cpu_share: float, lost_samples: int, said: Sequence[str]) -> Row:
    """A row of what the daemons said of each injection, and at the end. Raises RunError where that is missing.

    cpu_share: of one core, of all daemons; judged: injections that were tested; late: those learned from and in force
    with a later one.
    """
    records = [json.loads(line) for line in said if line.startswith("{")]
    words = [tuple(map(int, match.groups())) for line in said if (match := _LAST_WORDS.search(line))]
    if len(words) != number:
        last = "\n".join(said[-20:])
        raise RunError(f"{len(words)} of {number} injectors said what they counted:\n{last}")
    injections, late, passed_over = (sum(column) for column in zip(*words, strict=True))
    judged = sum(Reason.NOT_JUDGED.name not in record["reasons"] for record in records)
    return {
        "part": "injectors",
        "label": f"{number} injectors",
        "cpu_share": cpu_share,
        "lost_samples": lost_samples,
        "injections": injections,
        "not_judged": injections - judged,
        "learned": injections - passed_over,
        "late": late,
    }


def socket_bench(folder: Path, sockets: Sequence[socket.socket]) -> Path:
    """The example bench for injectors whose links are these sockets; `[link]` itself is not used."""
    inputs = ('\ntime_base = "device"', '\nlink = "{injector}"\ntime_base = "device"')
    path = write_bench(folder, "descriptor", "none", Ids(), inputs, ("\ninjector_id = 1", '\nlink = "{injector}"'))
    with path.open("a") as file:
        for number, link in enumerate(sockets):
            file.write(f'[links.i{number}]\nchannel = "{link.fileno()}"\n[injectors.i{number}]\n')
    return path
