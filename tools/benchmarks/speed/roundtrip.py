"""From the last input frame that a rate needs to that rate, on SocketCAN: ours, an echo in C, and python-can.

All are on one bus, each under its own identifiers, which the kernel sorts out; a part after the other sends to them
in turn, so that what else the machine does meets all.

usage: python -m tools.benchmarks.speed.roundtrip FOLDER CHANNEL SECONDS
"""

import json
import subprocess
import sys
from contextlib import ExitStack, nullcontext
from pathlib import Path

import numpy as np

from observer_rt.foundation.errors import RunError
from observer_rt.foundation.units import MICROSECOND
from tools.benchmarks.campaign import Row
from tools.benchmarks.speed import native
from tools.benchmarks.speed.observers import BUSY_RUN, RUN, Observer, observer
from tools.benchmarks.speed.pace import Pacer, Passage, latency_of
from tools.benchmarks.speed.traffic import Ids, Traffic, make_traffic, write_bench

ECHO, OURS, BUSY, PEER = "C echo", "observer_rt", "observer_rt, Python busy", "python-can, no observer"
PARTIES = {ECHO: Ids(0), OURS: Ids(1), BUSY: Ids(2), PEER: Ids(3)}
PACES = {"1.5 ms": 1.5e-3, "90 us": 90e-6}  # the one first at which nobody loses anything
SHARE = {"1.5 ms": 1.0, "90 us": 0.2}  # of the time
PARTS = 5  # of what is sent to each
WARMING = 1.0  # s
CHANNEL = "vcan0"
ROWS = "roundtrip.json"
_VCAN = Path(__file__).parents[2] / "vcan"


def measure_roundtrips(folder: Path, seconds: float) -> list[Row]:
    """Send to each party for `seconds` in all at the slow pace, a fifth at the fast one: a row a pace and party.

    Runs in user-mode Linux where the kernel of this machine has no CAN. Raises RunError.
    """
    own = [sys.executable, "-m", "tools.benchmarks.speed.roundtrip", folder, CHANNEL, seconds]
    done = subprocess.run([_VCAN, *map(str, own)], check=False)
    if done.returncode:
        raise RunError(f"the round trip could not be measured: exit code {done.returncode}")
    how = subprocess.run([_VCAN, "--how"], capture_output=True, text=True, check=True).stdout.strip()
    link = f"{CHANNEL} in user-mode Linux, one CPU" if how == "uml" else CHANNEL
    return [{**row, "link": link} for row in json.loads((folder / ROWS).read_text())]


def run_parties(folder: Path, channel: str, seconds: float) -> None:
    """The measurement itself, where the channel is; rows as a file in the folder."""
    traffic = make_traffic(folder)  # as the other parts have it
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
    rows = [row for pace, parties in passages.items() for row in rows_of(pace, parties, traffic)]
    (folder / ROWS).write_text(json.dumps(rows))


def rows_of(pace: str, parties: dict[str, list[Passage]], traffic: Traffic) -> list[Row]:
    """A row a party at a pace: latencies with the needle open, and how they compare.

    kept: whether the echo keeps the pace; where it does not the machine is too busy, and ratios to it mean nothing;
    excess: by how many of its medians a party's 99.9 % of all frames are beyond the echo's.
    """
    opened, every = (
        {
            party: latency_of(np.concatenate([each.latencies(traffic, open_only=open_only) for each in passages]))
            for party, passages in parties.items()
        }
        for open_only in (True, False)
    )
    return [
        {
            "part": "roundtrip",
            "label": f"{party}, a frame every {pace}",
            "party": party,
            **opened[party],
            "lost_samples": sum(each.lost(traffic) for each in passages),
            "kept": every[ECHO]["p50_us"] * MICROSECOND < PACES[pace],
            "vs_echo": opened[party]["p50_us"] / opened[ECHO]["p50_us"],
            "vs_ours": opened[party]["p50_us"] / opened[OURS]["p50_us"],  # counts where nothing is lost
            "excess": (every[party]["p999_us"] - every[ECHO]["p999_us"]) / every[party]["p50_us"],
        }
        for party, passages in parties.items()
    ]


def command_of(folder: Path, channel: str, party: str, traffic: Traffic) -> list[str | Path]:
    """What starts a party; what it needs is written into the folder."""
    ids = PARTIES[party]
    bench = write_bench(folder / f"party_{ids.number}", "socketcan", channel, ids)
    numbers = [str(ids.input), str(ids.rate), str(traffic.ahead)]
    if party == ECHO:
        return [native.program("echo", folder), channel, *numbers]
    if party == PEER:
        module = "tools.benchmarks.speed.python_peer"
        return [sys.executable, "-m", module, channel, bench.parent / "observer_fd.dbc", *numbers]
    return [*(BUSY_RUN if party == BUSY else RUN), bench]


def _send(to: Observer, pacer: Pacer, party: str, seconds: float, period: float) -> Passage:
    with to.resumed() if party == BUSY else nullcontext():
        return pacer.send(round(seconds / period), period)


if __name__ == "__main__":
    run_parties(Path(sys.argv[1]), sys.argv[2], float(sys.argv[3]))
