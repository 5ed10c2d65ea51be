"""`tools/bench speed`: its peers compute what ours computes, its sender sends what it should, its counts count."""

import socket
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import PACKAGE_DATA, load_bench, load_injector
from observer_rt.core.frames.frames import check_frame
from observer_rt.engine.service.core import Core
from tests.observed_plants import bench_at
from tools.benchmarks.speed import native
from tools.benchmarks.speed.observers import observer
from tools.benchmarks.speed.pace import Pacer, Passage
from tools.benchmarks.speed.python_peer import Estimator, Pair, Peer, QuasiStaticNozzle
from tools.benchmarks.speed.roundtrip import (
    ECHO,
    LEAN,
    PARTIES,
    PEER,
    command_of,
)
from tools.benchmarks.speed.sample import CObserver, OpenNeedle
from tools.benchmarks.speed.traffic import (
    DATA_ID,
    INPUT_ID,
    RATE_ID,
    RATES,
    RAW_FRAME,
    SAMPLE_RATE,
    SAMPLES,
    Ids,
    Traffic,
    index_of,
    payloads_of,
    write_bench,
)

PEER_FRAMES = 1400  # three injections
Answers = Callable[[bytes, int], list[bytes]]


def test_c_observer_computes_the_same_rates(tmp_path: Path) -> None:
    at = OpenNeedle()
    ours, in_c = at.ours(), CObserver(at, tmp_path).rates()
    assert len(ours) > 200  # an open needle of 2.5 ms
    assert np.max(ours) > 40e-6  # m3/s: of an injection, with wear learned
    np.testing.assert_allclose(in_c, ours, rtol=1e-9)


def answered(answers: Answers, payloads: list[bytes]) -> NDArray[np.float64]:
    """Rates [mm3/ms] of all rate frames, which follow one another."""
    found = [frame for n, payload in enumerate(payloads) for frame in answers(payload, n)]
    assert [index_of(frame) for frame in found] == list(range(0, RATES * len(found), RATES))
    return np.concatenate([np.frombuffer(frame[8:], "<u2") * 0.01 - 100.0 for frame in found])


@pytest.mark.parametrize(
    ("estimator", "largest", "mass"),
    [(Pair(load_injector(), SAMPLE_RATE), 2.0, 0.002), (QuasiStaticNozzle(load_injector()), 60.0, 0.05)],
    ids=["pair", "quasi-static"],
)
def test_python_peer_computes_what_the_core_computes(
    traffic: Traffic, estimator: Estimator, largest: float, mass: float
) -> None:
    """Of the model as given; the one without an observer roughly, but not the less work for it."""
    bench = bench_at(SAMPLE_RATE)
    core = Core(bench.injector, map_bus(bench), learning=False)
    peer = Peer(str(PACKAGE_DATA / "observer_fd.dbc"), INPUT_ID, RATE_ID, traffic.ahead, estimator)

    def ours(payload: bytes, number: int) -> list[bytes]:
        frames = core.handle(INPUT_ID, False, payload, number)
        return [frame.payload for frame in frames if frame.frame_id == RATE_ID]

    payloads = payloads_of(traffic)[:PEER_FRAMES]
    expected = answered(ours, payloads)
    rates = answered(lambda payload, _: peer.handle(payload), payloads)
    assert rates.size == expected.size  # sent after the same frames
    known = expected < 500.0  # not "not available"
    assert known[400:].all()
    assert np.max(np.abs(rates - expected)[known]) < largest
    assert np.sum(rates[known]) == pytest.approx(np.sum(expected[known]), rel=mass)


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
    protection = map_bus(bench_at(SAMPLE_RATE)).input_layouts[0].protection
    for place, payload in enumerate(frames["data"]):
        assert check_frame(payload, 64, protection)
        assert payload[2] == (first + place) % 256
        assert index_of(payload.tobytes()) == (first + place) * SAMPLES
        assert payload[8:].tobytes() == loop["data"][(first + place) % traffic.frames][8:].tobytes()


def test_echo_answers_when_the_observer_would(folder: Path, traffic: Traffic) -> None:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours, theirs:
        ids = Ids(1)
        numbers = (ids.input, ids.rate, traffic.ahead)
        words = [str(native.program("echo", folder)), f"fd:{theirs.fileno()}", *map(str, numbers)]
        with observer(words, [theirs.fileno()]):
            pacer = Pacer(folder, traffic, f"fd:{ours.fileno()}", ids, [ours.fileno()])
            passages = [pacer.send(400, 100e-6), pacer.send(400, 100e-6)]
    for passage in passages:
        assert passage.lost(traffic) == passage.repeated == 0
        latencies = passage.latencies(traffic, open_only=False)
        assert latencies.size >= 400 * SAMPLES // RATES - 1
        assert np.min(latencies) > 0.0
        assert np.median(latencies) < 10.0  # as it is sent, even on a machine with much else to do


@pytest.mark.vcan
@pytest.mark.parametrize("party", [ECHO, PEER, LEAN])
def test_peers_answer_on_a_bus(folder: Path, traffic: Traffic, vcan: str, party: str) -> None:
    ids = PARTIES[party]
    with observer(command_of(folder, vcan, party, traffic)):
        passage = Pacer(folder, traffic, vcan, ids).send(100, 5e-3)
    assert passage.lost(traffic) == passage.repeated == 0
    assert np.median(passage.latencies(traffic, open_only=False)) < 0.1


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


def test_observers_on_one_bus_have_identifiers_of_their_own(tmp_path: Path) -> None:
    messages = {
        frozenset(layout.frame_id for layout in (*bus.received, *bus.sent))
        for place in (0, 1, 4)
        for bus in [map_bus(load_bench(write_bench(tmp_path / str(place), "virtual", "x", Ids(place))))]
    }
    assert len(frozenset.union(*messages)) == 3 * 4
    assert all(Ids(place).input in frozenset.union(*messages) for place in (0, 1, 4))
