"""The main test: replay player, daemon and listener are three processes on a real SocketCAN interface."""

import sqlite3
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.bus.links.opening import open_link
from observer_rt.config.bench import load_bench, load_injector
from observer_rt.evaluation.evaluate import History, evaluate
from observer_rt.model.effects import sized
from observer_rt.observer.stream.state import Reason, State
from observer_rt.recording.formats import read_recording, write_recording
from observer_rt.simulation.schedule import make_schedule
from observer_rt.simulation.simulate import SimulatedNoise, simulate
from tests.benches import block_bench
from tests.device import worn_recording
from tests.interface import OwnInterface
from tests.service.end_to_end import (
    RATE,
    STATUS,
    SUMMARY,
    Heard,
    decoded,
    output_bus,
    published_rates,
    results_of,
    run_over,
    write_bench,
)

RAIL_PRESSURE = 100e6
ENERGIZING_TIME = 1.9e-3
PERIOD = 0.06


@dataclass(frozen=True)
class Run:
    """One recording over vcan0, and the same through `evaluate`."""

    heard: Heard
    history: History
    rate: NDArray[np.float64]  # published, mm3/ms
    count: NDArray[np.int64]
    true_rate: NDArray[np.float64]  # mm3/ms


def over_vcan(
    folder: Path,
    channel: str,
    rate_hz: float,
    speed: float,
    v_h: float,
    injections: int,
    noise: SimulatedNoise | None,
) -> Run:
    schedule = make_schedule([RAIL_PRESSURE], injections, PERIOD, [ENERGIZING_TIME])
    simulation = simulate(
        load_injector(), schedule, rate_hz, (sized("orifice_area", v_H=v_h),), noise, seed=7
    )
    path = folder / "recording.csv"
    write_recording(path, simulation.recording)
    bench = write_bench(folder, "socketcan", channel, rate_hz)
    samples = simulation.recording.samples
    with output_bus("socketcan", channel) as bus:
        heard = run_over(bench, path, bus, speed, samples)
    if heard.last_status()["DroppedFrames"]:
        pytest.fail("machine too slow: the daemon's socket dropped frames")
    rate, count = published_rates(heard.rates, samples)
    history = evaluate(load_bench(bench), [read_recording(path)])
    return Run(heard, history, rate, count, simulation.truth.injection_rate / 1e-6)


@pytest.mark.slow
@pytest.mark.vcan
def test_healthy_noise_free_recording_comes_back_as_the_true_rate(tmp_path: Path, vcan: str) -> None:
    run = over_vcan(tmp_path, vcan, 100e3, 0.05, 0.0, 3, None)
    assert_published_once(run)
    assert_equal_to_evaluation(run)
    known = ~np.isnan(run.rate)
    assert known[1000:].all()  # available since 3 ms of standstill, long before the first injection
    assert np.sqrt(np.mean((run.rate - run.true_rate)[known] ** 2)) <= 0.3


@pytest.mark.slow
@pytest.mark.vcan
def test_worn_nozzle_is_learned_on_the_bus(tmp_path: Path, vcan: str) -> None:
    """Over events 4-10 of 10; other wear gives the same frames as `evaluate`, which is judged by its own tests."""
    run = over_vcan(tmp_path, vcan, 50e3, 0.1, 0.3, 10, SimulatedNoise())
    assert_published_once(run)
    assert_equal_to_evaluation(run)
    summaries = [decoded(SUMMARY, payload) for payload in run.heard.summaries]
    assert [s["InjectionNumber"] for s in summaries] == list(range(1, 11))
    assert [s["Valid"] for s in summaries] == [0, 0] + 8 * [1]
    squares = []
    for summary in summaries[3:]:
        window = slice(int(summary["SampleIndex"]), int(summary["EndIndex"]) + 1)
        squares.append(np.mean((run.rate[window] - run.true_rate[window]) ** 2))
        true_mass = float(np.trapezoid(run.true_rate[window])) / 50e3 * 1e3 * 0.83  # mg
        assert summary["Mass"] == pytest.approx(true_mass, rel=0.01)
    assert np.sqrt(np.mean(squares)) <= 1.0


@contextmanager
def another_sender(channel: str, payload: bytes) -> Iterator[None]:
    """A node that sends summaries ten times a second."""
    stop = threading.Event()

    def send() -> None:
        with open_link("socketcan", channel, True, []) as link:
            while not stop.wait(0.1):
                link.send(SUMMARY.frame_id, payload, False, True)

    thread = threading.Thread(target=send)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


@pytest.mark.slow
@pytest.mark.vcan
def test_a_second_sender_makes_nothing_valid(tmp_path: Path, vcan: str) -> None:
    """The same in rates, summaries, status and journal."""
    schedule = make_schedule([RAIL_PRESSURE], 4, PERIOD, [ENERGIZING_TIME])
    recording = simulate(load_injector(), schedule, 50e3, (), SimulatedNoise(), seed=7).recording
    path, journal, foreign = tmp_path / "recording.csv", tmp_path / "journal.sqlite", bytes(64)
    write_recording(path, recording)
    bench = write_bench(tmp_path, "socketcan", vcan, 50e3)
    with output_bus("socketcan", vcan) as bus, another_sender(vcan, foreign):
        heard = run_over(bench, path, bus, 0.1, recording.samples, "--journal", str(journal))
    assert len(heard.rates) == -(-recording.samples // 28)
    rates = [decoded(RATE, payload) for payload in heard.rates]
    assert {(rate["Valid"], rate["State"]) for rate in rates} == {(0, State.DEGRADED)}
    summaries = [decoded(SUMMARY, payload) for payload in heard.summaries if payload != foreign]
    contested = 0.0, float(State.DEGRADED), float(Reason.SECOND_SENDER)
    assert [(s["Valid"], s["State"], s["Reason"]) for s in summaries] == [contested] * 4
    statuses = {
        (s["Valid"], s["State"], s["Reason"]) for s in (decoded(STATUS, each) for each in heard.statuses)
    }
    assert contested in statuses
    assert not any(valid for valid, *_ in statuses)
    with closing(sqlite3.connect(journal)) as connection:
        rows = connection.execute("SELECT valid, state, reasons FROM injection").fetchall()
    assert rows == [
        *2 * [(0, "DEGRADED", "SECOND_SENDER,TOO_FEW_EVENTS")],
        *2 * [(0, "DEGRADED", "SECOND_SENDER")],
    ]


def assert_published_once(run: Run) -> None:
    assert (run.count == 1).all()
    assert len(run.heard.rates) == -(-len(run.count) // 28)  # and none extra
    starts = [int(decoded(RATE, payload)["SampleIndex"]) for payload in run.heard.rates]
    assert starts == sorted(starts)
    # the status frame after SIGTERM tells of the samples too that the look-ahead held until then
    assert run.heard.last_status()["SamplesProcessed"] == len(run.count)


def assert_equal_to_evaluation(run: Run) -> None:
    """`evaluate --bench` and the daemon on vcan give the same frames, bit for bit, learning included."""
    assert run.heard.results == results_of(run.history.frames)


@pytest.mark.slow
@pytest.mark.vcan
def test_results_over_four_interfaces_equal_those_of_one_bus(
    tmp_path: Path, vcan: str, interfaces: list[OwnInterface]
) -> None:
    csv = tmp_path / "worn.csv"
    write_recording(csv, worn_recording())
    recording = read_recording(csv)
    one = block_bench(tmp_path / "one", "virtual", ["one"])
    expected = evaluate(load_bench(one), [recording]).frames
    four = block_bench(tmp_path / "four", "socketcan", [vcan, *(each.name for each in interfaces)])
    with output_bus("socketcan", interfaces[-1].name) as bus:
        heard = run_over(four, csv, bus, 0.05, recording.samples)
    if heard.last_status()["DroppedFrames"]:
        pytest.fail("machine too slow: a socket of the daemon dropped frames")
    assert heard.results == results_of(expected)
    assert len(heard.summaries) == 4
    assert heard.last_status()["TroubledBus"] == 0
