"""The demonstration of the closed loop: an effect no model has, refused, kept, named, taken over, valid again."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from threading import Thread
from typing import Any, NamedTuple

import pandas as pd
import tomlkit
from rich.console import Console
from rich.table import Table

from observer_rt.bus.links.link import Link
from observer_rt.bus.links.opening import open_link
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import EXAMPLE_BENCH, NOMINAL_INJECTOR, Bench, exact_text, load_bench
from observer_rt.daemon.journal import read_journal
from observer_rt.daemon.run import serve
from observer_rt.desk.demonstration.bench_injector import BenchOperation, BenchRecording, Departure, record
from observer_rt.desk.demonstration.worn import PERIOD, RAIL_PRESSURES, demo_link
from observer_rt.desk.evaluation.figures import ESTIMATED, NOMINAL, REFERENCE
from observer_rt.desk.take_over import take_over
from observer_rt.files.replay.framing import Framer, all_samples
from observer_rt.files.replay.player import play
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.console import plain_table
from observer_rt.foundation.errors import RunError
from observer_rt.foundation.figures import save_figure
from observer_rt.foundation.files import write_text
from observer_rt.foundation.options import RunOptions
from observer_rt.foundation.units import MILLIGRAM, MILLISECOND
from observer_rt.identification.discovery.amend import AMENDED
from observer_rt.identification.discovery.findings import FINDINGS
from observer_rt.identification.discovery.folder import REPORT

BEFORE, AFTER = 18, 12  # injections
LOG, JOURNAL, FOUND = "observer.log", "injections.sqlite", "missing"
SAMPLE_RATE = 100e3  # Hz
SPEED = 0.2  # 1: real time
ENERGIZING_TIMES = (0.9 * MILLISECOND, 1.9 * MILLISECOND)
QUIET = 1.5  # s for the last results to be written, and for the observer to begin anew
NICE = 15  # of the search, so that the daemon beside it comes first
_START = 30.0  # s that the daemon may need to be ready


class HiddenEffect(NamedTuple):
    """An effect that the daemon cannot learn: what the injector does, and in words."""

    departure: Departure
    words: str


def hidden_effect(seed: int, outside: bool) -> HiddenEffect:
    """Draw an effect that the daemon cannot learn; outside: a law that is in no vocabulary."""
    drawn = random.Random(seed)
    if outside:  # a law of the line: those of nozzle and seat the network learns, as it should
        loss, from_flow = drawn.uniform(0.04, 0.1), drawn.uniform(20.0, 30.0)
        words = f"a line that loses {loss:.3f} MPa per mm3/ms above {from_flow:.0f} mm3/ms"
        return HiddenEffect(Departure(loss=lambda flow: loss * max(flow - from_flow, 0.0)), words)
    kind = drawn.randrange(3)
    if kind == 0:
        n = drawn.uniform(5.0, 10.0)
        return HiddenEffect(Departure(stiffening=n), f"a bulk modulus that rises with pressure, n = {n:.1f}")
    if kind == 1:
        g = drawn.choice((-1.0, 1.0)) * drawn.uniform(0.012, 0.03)
        return HiddenEffect(Departure(rail_gain=g), f"a rail pressure sensor whose gain is {100 * g:+.1f} % off")
    x_0 = drawn.uniform(7.0, 12.0)
    return HiddenEffect(Departure(hidden_lift=x_0 * 1e-6), f"a needle lift recorded {x_0:.1f} um too low")


class LoopResult(NamedTuple):
    hidden: HiddenEffect
    injections: pd.DataFrame  # a row each: columns of the journal, `true` [mg], `error` [%], `amended`
    findings: dict[str, Any]  # findings.json
    report: Path  # its place


@dataclass
class EffectDemo:
    """A bench in an empty folder, an injector with a hidden effect, and the daemon that observes it."""

    folder: Path
    hidden: HiddenEffect
    seed: int
    speed: float
    say: Callable[[str], None]

    def run(self) -> LoopResult:
        """Serve the bench while the scene plays. Raises `RunError` where the daemon or the search fails."""
        file, failures = self._bench_file(), list[BaseException]()
        bench = load_bench(file)
        scenes = [self._recorded(BEFORE, self.seed), self._recorded(AFTER, self.seed + 1)]

        def play_scene() -> None:
            try:
                self._play(bench, scenes)
            except BaseException as error:
                failures.append(error)
            finally:
                os.kill(os.getpid(), signal.SIGTERM)  # as a user stops the daemon

        log = self.folder / LOG
        with Path(os.devnull).open("w") as nowhere:
            playing = Thread(target=play_scene, name="scene")
            playing.start()
            serve(lambda: load_bench(file), RunOptions(log=log, journal=self.folder / JOURNAL), Console(file=nowhere))
            playing.join()
        if failures:
            raise failures[0]
        return self._result(scenes)

    def _bench_file(self) -> Path:
        document: Any = tomlkit.parse(exact_text(EXAMPLE_BENCH))
        link = demo_link()
        document["link"]["interface"], document["link"]["channel"] = link.interface, link.channel
        document["learning"]["lockstep"] = True  # so that every demonstration is the same
        document["evidence"]["folder"] = "evidence"
        document["model"]["file"] = "injector.toml"
        write_text(self.folder / "injector.toml", exact_text(NOMINAL_INJECTOR))
        write_text(self.folder / "bench.toml", tomlkit.dumps(document))
        return self.folder / "bench.toml"

    def _recorded(self, injections: int, seed: int) -> BenchRecording:
        operation = BenchOperation(RAIL_PRESSURES, ENERGIZING_TIMES, injections, PERIOD)
        return record(operation, self.hidden.departure, SAMPLE_RATE, seed)

    def _play(self, bench: Bench, scenes: Sequence[BenchRecording]) -> None:
        """Send injections, which are refused; search the effect and take it over; send injections again."""
        link = bench.config.link
        self._wait_until_ready(1)
        with open_link(link.interface, link.channel, link.fd, []) as player:
            self._send(bench, scenes[0].recording, player)
            self.say("asking the events it refused what is missing (observer-rt discover --from-evidence) ...")
            amended = self._discover()
            if amended is None:
                raise RunError("no effect was found that may be taken over; see the report in the folder")
            done = take_over(bench.path, "", amended)
            self.say(f"taken over: the bench file names {done.step.as_text}; the daemon has it in force")
            self._wait_until_ready(2)
            time.sleep(QUIET)
            self._send(bench, scenes[1].recording, player)

    def _send(self, bench: Bench, recording: Recording, player: Link) -> None:
        play(Framer(map_bus(bench)).frames(recording, all_samples(recording)), player, self.speed)
        time.sleep(QUIET)

    def _wait_until_ready(self, times: int) -> None:
        """Raises `RunError` unless the log says within `_START` so many times that the daemon is ready."""
        patience = time.monotonic() + _START
        while time.monotonic() < patience:
            log = self.folder / LOG
            if log.exists() and log.read_text(encoding="utf-8").count(": ready\n") >= times:
                return
            time.sleep(0.05)
        raise RunError(f"the observer was not ready within {_START:g} s; see {self.folder / LOG}")

    def _discover(self) -> Path | None:
        """Run `discover` in its own process, beside the daemon; the amended file, None without one."""
        folder = self.folder / FOUND
        command = [sys.executable, "-m", "observer_rt", "discover", "--from-evidence", str(self.folder / "evidence")]
        command += ["--out", str(folder), "--accept-term", "1", "--force"]
        asked = subprocess.run(command, capture_output=True, text=True, check=False, preexec_fn=lambda: os.nice(NICE))
        if asked.returncode:
            raise RunError(f"`observer-rt discover` failed:\n{asked.stderr}")
        amended = folder / AMENDED
        return amended if amended.exists() else None

    def _result(self, scenes: Sequence[BenchRecording]) -> LoopResult:
        table = pd.DataFrame(read_journal(self.folder / JOURNAL).injections)
        table["amended"] = table.run != table.run.min()
        limits = zip(table.amended, table.start_index, table.end_index, strict=True)
        table["true"] = [scenes[amended].mass(first, last) / MILLIGRAM for amended, first, last in limits]
        table["error"] = 100.0 * (table.mass_mg.astype(float) / table.true - 1.0)
        findings = json.loads((self.folder / FOUND / FINDINGS).read_text(encoding="utf-8"))
        return LoopResult(self.hidden, table, findings, self.folder / FOUND / REPORT)


def loop_table(result: LoopResult) -> Table:
    """Masses and their errors, injection by injection."""
    headings = ("model", "rail [MPa]", "true [mg]", "observer [mg]", "error", "valid")
    rows = (
        (
            "amended" if row.amended else "as given",
            f"{row.rail_pressure_MPa:.0f}",
            f"{row.true:.2f}",
            f"{row.mass_mg:.2f}",
            f"{row.error:+.2f} %",
            "yes" if row.valid else str(row.reasons),
        )
        for row in result.injections.itertuples()
    )
    return plain_table(headings, rows, range(len(headings)), gap=1, title="Injected mass from the daemon's journal")


def write_loop_figure(result: LoopResult, path: Path) -> None:
    """Draw mass errors before and after the effect was taken over, beside the gap of the line pressure."""
    import matplotlib.pyplot as plt

    figure, (masses, gap) = plt.subplots(1, 2, figsize=(11, 4), width_ratios=(3, 1), layout="constrained")
    injections = result.injections
    before = int((~injections.amended).sum())
    for valid, label, colour, fill in ((False, "not valid", "0.6", "none"), (True, "valid", ESTIMATED, ESTIMATED)):
        rows = injections[injections.valid == valid]
        if len(rows):
            masses.plot(rows.index + 1, rows.error, "o", color=colour, mfc=fill, label=label)
    masses.axhline(0, color=REFERENCE, lw=0.8)
    masses.axvline(before + 0.5, color=NOMINAL, ls="--")
    masses.annotate(
        "taken over", (before + 0.5, 1), (4, -12), xycoords=("data", "axes fraction"), textcoords="offset points"
    )
    masses.set(xlabel="injection", ylabel="error of the injected mass [%]", title=f"hidden: {result.hidden.words}")
    masses.legend(loc="upper right")
    masses.margins(y=0.15)
    line = result.findings["gap"]["line_pressure"]
    heights = [line["before_MPa"], line["after_MPa"], line["noise_floor_MPa"]]
    bars = gap.bar(["before", "after", "noise"], heights, color=["0.6", ESTIMATED, "0.85"])
    gap.bar_label(bars, fmt="%.2f")
    gap.margins(y=0.1)
    gap.set(ylabel="line pressure, model against measured [MPa]", title="the gap")
    save_figure(figure, path, 110)
    plt.close(figure)
