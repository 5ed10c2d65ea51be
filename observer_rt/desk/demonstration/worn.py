"""The demonstration: a worn injector, replayed as CAN FD frames to the function that `run` starts."""

import contextlib
import math
import threading
import time
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rich.table import Table

from observer_rt.bus.links.opening import open_link
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import Bench, load_bench
from observer_rt.config.bench_file import LinkConfig
from observer_rt.daemon.daemon import Daemon
from observer_rt.daemon.snapshot_keeper import SnapshotKeeper
from observer_rt.daemon.view import View
from observer_rt.desk.demonstration.bench_injector import BenchOperation, Departure, record
from observer_rt.desk.evaluation.curves import MassRow, RateCurves
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.reports.news import News
from observer_rt.engine.service.nominal import ComparedRate, NominalInjection
from observer_rt.files.replay.framing import Framer, all_samples
from observer_rt.files.replay.player import play
from observer_rt.foundation.console import plain_table
from observer_rt.foundation.stop_request import stop_on_signals
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MILLISECOND, Floats

FIGURES = "observer_rt.desk.evaluation.figures"
RAIL_PRESSURES = (60 * MEGAPASCAL, 100 * MEGAPASCAL, 140 * MEGAPASCAL)
ENERGIZING_TIME = 1.9 * MILLISECOND
PERIOD = 60 * MILLISECOND
VCAN = "vcan0"
_QUIET = 1.0  # s without a frame after which the bus has nothing more to say


class DemoResult(NamedTuple):
    """Results published on a link: rates of some injections [m3/s], masses of all."""

    curves: Mapping[int, RateCurves]
    masses: tuple[MassRow, ...]
    link: str


def mass_table(result: DemoResult) -> Table:
    """Masses and their errors, injection by injection."""
    headings = ("injection", "true [mg]", "nominal [mg]", "error", "observer [mg]", "error", "valid")
    title = f"Injected mass as published on {result.link}"
    return plain_table(headings, [[*_cells(row)] for row in result.masses], range(len(headings)), gap=1, title=title)


def _cells(row: MassRow) -> Iterator[str]:
    true = row.reference or math.nan
    yield from (str(row.number), f"{true / MILLIGRAM:.2f}")
    for mass in (row.nominal, row.estimated):
        yield from (f"{mass / MILLIGRAM:.2f}", f"{100 * (mass / true - 1):+.2f} %")
    yield "yes" if row.valid else "not yet"


def demo_link() -> LinkConfig:
    """The bus of a demonstration: vcan0 where there is one, else a virtual one of its own."""
    if Path(f"/sys/class/net/{VCAN}").exists():
        return LinkConfig(channel=VCAN)
    return LinkConfig(interface="virtual", channel=f"demo-{uuid.uuid4().hex[:8]}")


class Demo:
    """Bench, worn injector and references of one demonstration."""

    def __init__(self, wear: float, injections: int, seed: int) -> None:
        """wear: v_H of (27)."""
        self.link = demo_link()
        self.bench = _on_link(load_bench().exact, self.link)
        operation = BenchOperation(RAIL_PRESSURES, [ENERGIZING_TIME], injections, PERIOD)
        self._truth = record(operation, Departure(nozzle=1.0 + wear), self.bench.injector.sample_rate, seed)
        self.recording = self._truth.recording
        self._nominal = NominalInjection(self.bench.injector)
        self._compared: dict[int, Sequence[ComparedRate]] = {}  # true and nominal, by the injection
        self._published: dict[int, Floats] = {}
        self._reports: list[InjectionReport] = []

    def run(self, speed: float, show: Callable[[View, threading.Event], None] | None = None) -> DemoResult:
        """Replay at `speed` (1: real time), drawn by `show`. Raises `RunError`, by a signal `KeyboardInterrupt`."""
        bus = map_bus(self.bench)
        ends = self.link.interface, self.link.channel, self.link.fd
        on = f"{self.link.interface} {self.link.channel}"
        snapshots = SnapshotKeeper(self.bench, lambda report, _: self._compared[report.number])
        view = View(f"observer_rt demo: {on}", snapshots.take)
        stop, done = threading.Event(), threading.Event()
        inputs = [(layout.frame_id, layout.is_extended) for layout in bus.received]
        with contextlib.ExitStack() as stack:
            interrupted = stack.enter_context(stop_on_signals())
            player_link = stack.enter_context(open_link(*ends, []))
            daemon_link = stack.enter_context(open_link(*ends, inputs))
            threads = stack.enter_context(ThreadPoolExecutor(3))
            threads.submit(import_module, FIGURES)  # which takes seconds, of which the replay needs nothing

            def compare(news: News) -> None:
                if isinstance(news, InjectionReport):
                    self._reports.append(news)
                    rows = daemon.core.rows(news.start_position, news.end_position + 1)
                    rate = self._truth.injection_rate[news.start_index : news.end_index + 1]
                    true = ComparedRate("true", rate, self._truth.mass(news.start_index, news.end_index))
                    self._compared[news.number] = [true, *self._nominal(news, rows)]
                    self._published[news.number] = rows["injection_rate"].copy()

            daemon = Daemon(self.bench, bus, [daemon_link], listeners=[compare, snapshots.hear])
            snapshots.watch(daemon)

            def replay() -> None:
                try:
                    frames = Framer(bus).frames(self.recording, all_samples(self.recording))
                    play(frames, player_link, speed, stop=interrupted)
                    _wait_until_quiet(daemon, interrupted)
                finally:
                    stop.set()
                    done.set()

            serving = threads.submit(daemon.run, stop)
            playing = threads.submit(replay)
            if show is not None:
                show(view, done)
            playing.result()
            serving.result()
            if interrupted.is_set():
                raise KeyboardInterrupt
            return self._result()

    def _result(self) -> DemoResult:
        curves, masses = {}, []
        for report in self._reports:
            true, nominal = self._compared[report.number]
            masses.append(MassRow(report.number, report.mass, nominal.mass, true.mass, report.valid))
            if report.number in (1, 3, len(self._reports)):
                curves[report.number] = RateCurves(
                    f"injection {report.number}, {report.rail_pressure / MEGAPASCAL:.0f} MPa",
                    np.arange(nominal.rate.size) / self.recording.sample_rate,
                    self._published[report.number],
                    nominal.rate,
                    true.rate,
                    corrected=report.corrected_rate,
                )
        return DemoResult(curves, tuple(masses), f"{self.link.interface} {self.link.channel}")


def write_figure(result: DemoResult, wear: float, path: Path) -> None:
    """Draw rates and masses of a demonstration, format by suffix."""
    from observer_rt.desk.evaluation.figures import Picture, plot_injections

    title = f"An injector with a worn nozzle (v_H = {wear:+.2f}), over CAN"
    plot_injections(path, [Picture(title, result.curves, result.masses)], "true")


def _on_link(bench: Bench, link: LinkConfig) -> Bench:
    """The bench on another link, learning in lockstep so that every demonstration is the same."""
    learning = bench.injector.config.learning.model_copy(update={"lockstep": True})
    return replace(bench, config=bench.config.model_copy(update={"link": link})).with_sections(learning=learning)


def _wait_until_quiet(daemon: Daemon, interrupted: threading.Event) -> None:
    seen, since = -1, time.monotonic()
    while time.monotonic() - since < _QUIET and not interrupted.wait(0.05):
        processed = daemon.core.processed
        if processed != seen:
            seen, since = processed, time.monotonic()
