"""From the last input frame that a rate frame needs to that rate frame, on SocketCAN: ours, a C echo, and a peer.

All are on one bus, each under its own identifiers, which the kernel sorts out; a part after the other sends to them
in turn, so that what else the machine does meets all.

usage: python -m tools.benchmarks.speed.roundtrip FOLDER CHANNEL SECONDS
"""

import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from observer_rt.foundation.errors import RunError
from observer_rt.foundation.units import MICROSECOND
from tests.plants.arrays import Array
from tools.benchmarks.speed import native
from tools.benchmarks.speed.observers import BUSY_RUN, RUN, Observer, observer
from tools.benchmarks.speed.pace import Latency, Pacer, Passage, latency_of
from tools.benchmarks.speed.sustained import farewell
from tools.benchmarks.speed.traffic import Ids, Traffic, load_traffic, write_bench

ECHO, OURS, BUSY, PEER = "C echo", "observer_rt", "observer_rt, Python busy", "python-can peer"
LEAN = "python-can, no observer"  # a lower limit of such a daemon
ESTIMATORS = {PEER: "pair", LEAN: "quasi_static"}
PARTIES = {ECHO: Ids(0), OURS: Ids(1), BUSY: Ids(2), PEER: Ids(3), LEAN: Ids(4)}
PACES = {"1.5 ms": 1.5e-3, "90 us": 90e-6}  # the one first at which nobody loses anything
SHARE = {"1.5 ms": 1.0, "90 us": 0.2}  # of the time
PARTS = 5  # of what is sent to each
WARMING = 1.0  # s
CHANNEL = "vcan0"
_VCAN = Path(__file__).parents[2] / "vcan"


@dataclass(frozen=True)
class RoundTrip:
    """One party at one pace: needle open, and all frames; lost: rate frames that never came."""

    open_needle: Latency
    all_frames: Latency
    lost_samples: int


_MEASURED = TypeAdapter(tuple[Mapping[str, Mapping[str, RoundTrip]], Mapping[str, str]])
"""By pace and party, and last words by party: what one process tells another."""


@dataclass(frozen=True)
class RoundTrips:
    """By pace and party. said: the last words of each; latencies [s]: with the needle open, by `pace, party`."""

    link: str
    found: Mapping[str, Mapping[str, RoundTrip]]
    said: Mapping[str, str]
    latencies: Mapping[str, Array]

    def document(self) -> dict[str, Any]:
        """For JSON."""
        found, said = _MEASURED.dump_python((self.found, self.said))
        return {"link": self.link, "found": found, "said": said}

    def is_kept(self, pace: str) -> bool:
        """Whether the echo keeps a pace; where it does not the machine is too busy, and ratios to it mean nothing."""
        return self.found[pace][ECHO].all_frames.p50 * MICROSECOND < PACES[pace]

    def ratio(self, over: str, under: str) -> float | None:
        """Of medians with the needle open, the largest of the paces the echo keeps; None: it keeps none."""
        return max(
            (each[over].open_needle.p50 / each[under].open_needle.p50 for each in self._kept), default=None
        )

    def speedup(self, peer: str) -> float | None:
        """How many times faster ours is, the least of the paces at which the peer loses nothing; None: of none."""
        found = [
            each[peer].open_needle.p50 / each[OURS].open_needle.p50
            for each in self._kept
            if each[peer].lost_samples == 0
        ]
        return min(found, default=None)

    def excess(self, party: str) -> float | None:
        """By how many of its medians its 99.9 % are beyond those of the echo, the most of the paces it keeps."""
        return max(
            (
                (each[party].all_frames.p999 - each[ECHO].all_frames.p999) / each[party].all_frames.p50
                for each in self._kept
            ),
            default=None,
        )

    @property
    def _kept(self) -> list[Mapping[str, RoundTrip]]:
        return [each for pace, each in self.found.items() if self.is_kept(pace)]


def measure_roundtrips(folder: Path, seconds: float) -> RoundTrips:
    """Send to each party for `seconds` in all at the slow pace, a fifth of it at the fast one.

    The folder holds the traffic. Runs in user-mode Linux where the kernel of this machine has no CAN. Raises
    RunError.
    """
    own = [sys.executable, "-m", "tools.benchmarks.speed.roundtrip", folder, CHANNEL, seconds]
    done = subprocess.run([_VCAN, *map(str, own)], check=False)
    if done.returncode:
        raise RunError(f"the round trip could not be measured: exit code {done.returncode}")
    found, said = _MEASURED.validate_json((folder / "roundtrip.json").read_bytes())
    how = subprocess.run([_VCAN, "--how"], capture_output=True, text=True, check=True).stdout.strip()
    link = f"{CHANNEL} in user-mode Linux, one CPU" if how == "uml" else CHANNEL
    with np.load(folder / "roundtrip.npz") as latencies:
        return RoundTrips(link, found, said, dict(latencies))


def run_parties(folder: Path, channel: str, seconds: float) -> None:
    """The measurement itself, where the channel is; results as files in the folder."""
    traffic = load_traffic(folder)
    with ExitStack() as stack:
        running = {}
        for party in PARTIES:
            running[party] = stack.enter_context(observer(command_of(folder, channel, party, traffic)))
            if party == BUSY:
                running[party].suspend()
        pacers = {party: Pacer(folder, traffic, channel, ids) for party, ids in PARTIES.items()}
        for party in PARTIES:  # meets what is met for the first time
            _send(running[party], pacers[party], party, WARMING, PACES["1.5 ms"])
        passages: dict[str, dict[str, list[Passage]]] = {pace: {p: [] for p in PARTIES} for pace in PACES}
        for pace, period in PACES.items():
            for party in PARTS * tuple(PARTIES):  # one part after the other to every party
                part = _send(running[party], pacers[party], party, seconds * SHARE[pace] / PARTS, period)
                passages[pace][party].append(part)
    found = {
        pace: {party: _round_trip(each, traffic) for party, each in parties.items()}
        for pace, parties in passages.items()
    }
    said = {party: farewell(each) or (each.said[-1] if each.said else "") for party, each in running.items()}
    (folder / "roundtrip.json").write_bytes(_MEASURED.dump_json((found, said)))
    latencies = {
        f"{pace}, {party}": _latencies(each, traffic, open_only=True)
        for pace, parties in passages.items()
        for party, each in parties.items()
    }
    np.savez(folder / "roundtrip.npz", **latencies)  # type: ignore[arg-type]


def command_of(folder: Path, channel: str, party: str, traffic: Traffic) -> list[str | Path]:
    """What starts a party; what it needs is written into the folder."""
    ids = PARTIES[party]
    bench = write_bench(folder / f"party_{ids.place}", "socketcan", channel, ids)
    numbers = [str(ids.input), str(ids.rate), str(traffic.ahead)]
    if party == ECHO:
        return [native.program("echo", folder), channel, *numbers]
    if party in ESTIMATORS:
        module = "tools.benchmarks.speed.python_peer"
        return [
            sys.executable,
            "-m",
            module,
            channel,
            bench.parent / "observer_fd.dbc",
            *numbers,
            ESTIMATORS[party],
        ]
    return [*(BUSY_RUN if party == BUSY else RUN), bench]


def _send(to: Observer, pacer: Pacer, party: str, seconds: float, period: float) -> Passage:
    with to.resumed() if party == BUSY else nullcontext():
        return pacer.send(round(seconds / period), period)


def _round_trip(passages: Sequence[Passage], traffic: Traffic) -> RoundTrip:
    return RoundTrip(
        latency_of(_latencies(passages, traffic, open_only=True)),
        latency_of(_latencies(passages, traffic, open_only=False)),
        sum(each.lost(traffic) for each in passages),
    )


def _latencies(passages: Sequence[Passage], traffic: Traffic, *, open_only: bool) -> Array:
    return np.concatenate([each.latencies(traffic, open_only=open_only) for each in passages])


if __name__ == "__main__":
    run_parties(Path(sys.argv[1]), sys.argv[2], float(sys.argv[3]))
