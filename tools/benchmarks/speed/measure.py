"""The commands `speed` and `soak` of `tools/bench`: figures beside their bars, tables, a document and a histogram."""

import os
import tempfile
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import asdict, dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import matplotlib.pyplot as plt
import numpy as np
import typer
from matplotlib.axes import Axes
from rich.table import Table

from observer_rt.foundation.units import MICROSECOND
from tests.plants.arrays import Array
from tools.benchmarks.command_line import JsonOption, app, chosen_names, messages, tell_figures
from tools.benchmarks.figures import COLOURS
from tools.benchmarks.report import Figure, Shown, figures_table, list_of, put_out, table_of
from tools.benchmarks.speed.core_alone import (
    ARRAYS,
    CAN_LOG,
    MDF4,
    PARQUET,
    EvaluateTimes,
    ScalingRow,
    exponent,
    measure_evaluate,
    measure_scaling,
)
from tools.benchmarks.speed.injectors import NUMBERS, InjectorsRow, measure_injectors
from tools.benchmarks.speed.kept import WITH, WITHOUT, KeptRow, measure_kept
from tools.benchmarks.speed.roundtrip import (
    BUSY,
    ECHO,
    LEAN,
    OURS,
    PACES,
    PEER,
    RoundTrips,
    measure_roundtrips,
)
from tools.benchmarks.speed.sample import SampleTimes, measure_sample
from tools.benchmarks.speed.sustained import (
    Startup,
    Sustained,
    measure_startup,
    measure_sustained,
    run_soak,
    soak_table,
)
from tools.benchmarks.speed.traffic import SAMPLES, make_traffic

SECONDS, QUICK_SECONDS = 600.0, 10.0
ROUNDTRIP_SECONDS, QUICK_ROUNDTRIP_SECONDS = 50.0, 5.0
INJECTORS_SECONDS, QUICK_INJECTORS_SECONDS = 60.0, 10.0
KEPT_SECONDS, QUICK_KEPT_SECONDS = 120.0, 10.0
TABLE_WIDTH = 170  # where stdout is no terminal
EVALUATE_BARS = {ARRAYS: 0.8, PARQUET: 0.5, MDF4: 0.5, CAN_LOG: 0.5}
"""Of the core's speed, by what is evaluated."""
_STYLE = {OURS: 0, ECHO: 1, PEER: 2, LEAN: 3, BUSY: 4}
_BINS = 60


class Part(StrEnum):
    """What `--only` chooses from, in the order it is measured."""

    SUSTAINED = "sustained"
    ROUNDTRIP = "roundtrip"
    SAMPLE = "sample"
    EVALUATE = "evaluate"
    STARTUP = "startup"
    SCALING = "scaling"
    INJECTORS = "injectors"
    EVIDENCE = "evidence"


@dataclass(frozen=True)
class SpeedPlan:
    """What is measured. seconds: of the sustained rate; roundtrip_seconds: to each party.

    injectors_seconds: to each number of injectors; kept_seconds: with evidence kept, and without.
    """

    parts: Collection[Part]
    seconds: float
    roundtrip_seconds: float
    injectors_seconds: float
    kept_seconds: float


@dataclass(frozen=True)
class Speed:
    """What was measured, by `Part`; None: was not. load: of the machine in the last minute, before and after."""

    load: tuple[float, float]
    sustained: Sustained | None = None
    roundtrip: RoundTrips | None = None
    sample: SampleTimes | None = None
    evaluate: EvaluateTimes | None = None
    startup: Startup | None = None
    scaling: tuple[ScalingRow, ...] = ()
    injectors: tuple[InjectorsRow, ...] = ()
    evidence: Mapping[str, KeptRow] | None = None


def measure_speed(plan: SpeedPlan) -> Speed:
    """Measure part after part. Raises UserError, RunError."""
    before = os.getloadavg()[0]
    found: dict[str, Any] = {}
    with tempfile.TemporaryDirectory(prefix="speed-") as name:
        folder = Path(name)
        traffic = make_traffic(folder)
        measures: dict[Part, Callable[[], Any]] = {
            Part.SUSTAINED: lambda: measure_sustained(folder, traffic, plan.seconds),
            Part.ROUNDTRIP: lambda: measure_roundtrips(folder, plan.roundtrip_seconds),
            Part.SAMPLE: lambda: measure_sample(folder),
            Part.EVALUATE: lambda: measure_evaluate(folder),
            Part.STARTUP: lambda: measure_startup(folder),
            Part.SCALING: lambda: tuple(measure_scaling()),
            Part.INJECTORS: lambda: measure_injectors(folder, traffic, plan.injectors_seconds),
            Part.EVIDENCE: lambda: measure_kept(folder, traffic, plan.kept_seconds),
        }
        for part, measure in measures.items():
            if part in plan.parts:
                messages.print(f"{part} ...", highlight=False)
                found[part] = measure()
    return Speed((before, os.getloadavg()[0]), **found)


def figures(speed: Speed) -> list[Figure]:
    """All of them, None for those not measured."""
    made: list[Figure] = []

    def add(name: str, part: Any, of: Callable[[Any], float | None], peer: str = "", **bar: float) -> None:
        made.append(Figure(name, of(part) if part else None, peer, **bar))

    trips, echo, excess = speed.roundtrip, "C echo, worst pace", "C echo's own, in p50 of ours"
    add("roundtrip_p50_vs_c_echo", trips, lambda f: f.ratio(OURS, ECHO), echo, at_most=1.25)
    add("roundtrip_busy_p50_vs_c_echo", trips, lambda f: f.ratio(BUSY, ECHO), echo, at_most=2.0)
    quiet = "ours, Python quiet"
    add("roundtrip_busy_p50_vs_quiet", trips, lambda f: f.ratio(BUSY, OURS), quiet, at_most=1.1)
    add("roundtrip_p999_excess", trips, lambda f: f.excess(OURS), excess, at_most=1.5)
    add("roundtrip_busy_p999_excess", trips, lambda f: f.excess(BUSY), excess, at_most=2.0)
    peer, lean = "python-can, cantools, numpy; paces it keeps", "the same without an observer"
    add("roundtrip_speedup_vs_python_can", trips, lambda f: f.speedup(PEER), peer, at_least=5.0)
    add("roundtrip_speedup_vs_python_can_lean", trips, lambda f: f.speedup(LEAN), lean)
    rate = speed.sustained
    add("sustained_khz", rate, lambda f: f.sustained_khz, "100 kHz sent", at_least=99.9)
    add("cpu_share", rate, lambda f: f.cpu_share, "one core", at_most=0.35)
    add("lost_samples", rate, lambda f: float(f.lost_samples), "all sent", at_most=0.0)
    add("sustained_p999_us", rate, lambda f: f.latency.p999)
    add("sample_vs_c", speed.sample, lambda f: f.ratio, "C -O3, same tanh", at_most=1.1)
    no_events = "the same C: no events, no statistics"
    add("whole_step_vs_c", speed.sample, lambda f: f.whole / f.in_c, no_events)
    alone = "the compiled core alone, nothing learned"
    for source, bar in EVALUATE_BARS.items():
        name = f"evaluate_{source.replace(' ', '_')}_vs_core"
        add(name, speed.evaluate, lambda f, source=source: f.share(source), alone, at_least=bar)  # type: ignore[misc]
    add("ready_s", speed.startup, lambda f: f.ready_s, at_most=1.2)
    add("memory_mib", speed.startup, lambda f: f.memory_mib, at_most=180.0)
    add("samples_exponent", speed.scaling, exponent, "1: linear", at_most=1.1)
    most = speed.injectors and speed.injectors[-1]
    what = f"{NUMBERS[-1]} injectors, windows, learning"
    add("injectors_cpu_share", most, lambda f: f.cpu_share, f"one core; {what}", at_most=0.75)
    add("injectors_lost_samples", most, lambda f: float(f.lost_samples), what, at_most=0.0)
    add("injectors_not_judged", most, lambda f: float(f.injections - f.judged), what, at_most=0.0)
    kept = speed.evidence
    add("evidence_cpu_ratio", kept, lambda f: f[WITH].cpu_share / f[WITHOUT].cpu_share, WITHOUT, at_most=1.05)
    add("evidence_p999_ratio", kept, lambda f: f[WITH].p999 / f[WITHOUT].p999, WITHOUT, at_most=1.1)
    add("block_samples", speed, lambda _: SAMPLES)
    add("substeps", speed.sample, lambda f: float(f.substeps))
    return made


def shown(speed: Speed) -> Iterator[Shown]:
    """What there is something for."""
    yield figures_table(figures(speed), "speed", speed.load)
    if speed.roundtrip:
        yield _round_trip_table(speed.roundtrip)
        yield from (f"{who}, {text}" for who, text in speed.roundtrip.said.items() if "us a frame" in text)
    if speed.sustained:
        shares = ", ".join(f"{share:.2f}" for share in speed.sustained.thread_shares[:4])
        text = f"socket pair: {speed.sustained.latency}; busiest threads {shares} of a core"
        yield f"{text}; {speed.sustained.farewell}"
    if speed.sample:
        times = speed.sample
        text = f"open sample: {times.ours:.2f} us, in C {times.in_c:.2f}, whole step {times.whole:.2f}"
        yield f"{text}; the same rates to {times.largest_difference:.1e}"
    if speed.evaluate:
        yield _evaluate_table(speed.evaluate)
    if speed.startup:
        started = speed.startup
        yield f"start-up: {started.imports_s:.1f} s until its first word, {started.cpu_s:.1f} s of processor time"
    if speed.scaling:
        columns = {"grows": "{.what}", "to": "{.value:g}", "us a sample": "{.us_a_sample:.2f}"}
        yield list_of("scaling", [speed.scaling], columns)
    if speed.injectors:
        title = "injectors, a daemon each, windows of 100 kHz, 25 injections a second each"
        columns = {"injectors": "{.injectors}", "CPU": "{.cpu_share:.2f}", "lost samples": "{.lost_samples}"}
        columns |= {"injections": "{.injections}", "judged": "{.judged}", "learned from": "{.learned}"}
        yield list_of(title, [speed.injectors], {**columns, "of these late": "{.late}"})
    if speed.evidence:
        columns = {"p50, us": "{.p50:.1f}", "p99.9, us": "{.p999:.0f}", "CPU": "{.cpu_share:.3f}"}
        columns |= {"lost samples": "{.lost_samples}", "said": "{.kept}"}
        yield table_of("100 kHz, learning, in turn; the median turn", "", speed.evidence, columns)


def speed_document(speed: Speed) -> dict[str, Any]:
    """`figures` by name, `details` of what was measured."""
    link = speed.roundtrip.link if speed.roundtrip else None
    return {
        "figures": {each.name: each.value for each in figures(speed)} | {"link": link},
        "details": {
            "load": speed.load,
            "missed": [each.name for each in figures(speed) if each.is_met is False],
            "roundtrip": speed.roundtrip and speed.roundtrip.document(),
            "sustained": speed.sustained and speed.sustained.document(),
            "sample": speed.sample and asdict(speed.sample),
            "evaluate": speed.evaluate and asdict(speed.evaluate),
            "startup": speed.startup and asdict(speed.startup),
            "scaling": [asdict(row) for row in speed.scaling],
            "injectors": [asdict(row) for row in speed.injectors],
            "evidence": speed.evidence and {name: asdict(row) for name, row in speed.evidence.items()},
        },
    }


def _round_trip_table(found: RoundTrips) -> Table:
    title = f"round trip on {found.link}: p50 / p99 / p99.9 (answers)"
    table = Table(
        "pace", "", "needle open", "x echo", "all", "lost samples", title=title, title_justify="left"
    )
    for pace, parties in found.found.items():
        for party, each in parties.items():
            ratio = f"{each.open_needle.p50 / parties[ECHO].open_needle.p50:.1f}"
            lost = str(each.lost_samples)
            table.add_row(pace, party, str(each.open_needle), ratio, str(each.all_frames), lost)
        if not found.is_kept(pace):
            table.add_row(pace, "the echo falls behind: too busy a machine, no verdict at this pace")
        table.add_section()
    return table


def _evaluate_table(times: EvaluateTimes) -> Table:
    title = f"evaluate, us a sample ({times.seconds:g} s, nothing learned; verdicts {times.verdicts.processor:.2f})"
    rows = {"compiled core alone": (times.core, None, None)} | {
        source: (cost, times.share(source), times.processor_share(source))
        for source, cost in times.whole.items()
    }
    columns = {"clock": "{[0].wall:.2f}", "of the core's speed": "{[1]!p:.0f} %"}
    columns |= {"processor": "{[0].processor:.2f}", "of the core's": "{[2]!p:.0f} %"}
    return table_of(title, "", rows, columns)


def save_histograms(speed: Speed, folder: Path) -> Path | None:
    """Share of the answers by latency, a panel for each pace and one for the socket pair; None without any."""
    panels: dict[str, Mapping[str, Array]] = {}
    if speed.roundtrip:
        named = speed.roundtrip.latencies
        for pace in PACES:
            of_pace = {party: named[f"{pace}, {party}"] for party in _STYLE}
            panels[f"round trip on {speed.roundtrip.link}, needle open, a frame every {pace}"] = of_pace
    if speed.sustained:
        panels["socket pair, a frame every 90 us"] = {OURS: speed.sustained.latencies}
    if not panels:
        return None
    folder.mkdir(parents=True, exist_ok=True)
    height = 3.0 * len(panels)
    figure, axes = plt.subplots(
        len(panels), 1, figsize=(12.0, height), layout="constrained", squeeze=False, sharex=True
    )
    for axis, (title, found) in zip(axes[:, 0], panels.items(), strict=True):
        _panel(axis, title, found)
    axes[-1, 0].set_xlabel("from the last input frame needed to the rate frame [us]")
    path = folder / "latency.png"
    figure.savefig(path, dpi=150)
    plt.close(figure)
    return path


def _panel(axis: Axes, title: str, found: Mapping[str, Array]) -> None:
    every = np.concatenate(list(found.values())) / MICROSECOND
    bins = np.geomspace(max(every.min(), 1.0), every.max() * 1.01, _BINS).tolist()
    for party, seconds in found.items():
        if seconds.size:
            microseconds = seconds / MICROSECOND
            share = np.full(seconds.size, 1.0 / seconds.size)
            label = f"{party}: median {np.median(microseconds):.0f} us"
            colour = COLOURS[_STYLE[party]]
            axis.hist(microseconds, bins, weights=share, histtype="step", label=label, color=colour, lw=1.4)
    axis.set(title=title, xscale="log", ylabel="share of answers")
    axis.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))


@app.command(
    epilog="Examples: tools/bench speed --figures build/speed; tools/bench speed --quick --only sample,startup"
)
def speed(
    only: Annotated[str, typer.Option(help=f"Of {', '.join(Part)}, by commas (default: all).")] = "",
    quick: Annotated[bool, typer.Option("--quick", help="10 s of each: a look, no verdict.")] = False,
    seconds: Annotated[float | None, typer.Option(min=1.0, help="Of the sustained rate (600).")] = None,
    figures: Annotated[Path | None, typer.Option(help="Folder for the histogram of latencies.")] = None,
    as_json: JsonOption = False,
) -> None:
    """How fast, each beside a named peer: round trip, rate, a sample, start, scaling."""
    plan = SpeedPlan(
        tuple(map(Part, chosen_names(only, "--only", list(Part), list(Part)))),
        seconds or (QUICK_SECONDS if quick else SECONDS),
        QUICK_ROUNDTRIP_SECONDS if quick else ROUNDTRIP_SECONDS,
        QUICK_INJECTORS_SECONDS if quick else INJECTORS_SECONDS,
        QUICK_KEPT_SECONDS if quick else KEPT_SECONDS,
    )
    found = measure_speed(plan)
    if figures is not None and (figure := save_histograms(found, figures)):
        tell_figures([figure])
    put_out(as_json, speed_document(found), shown(found), TABLE_WIDTH)


@app.command(epilog="Example: tools/bench soak --minutes 60")
def soak(
    minutes: Annotated[float, typer.Option(min=0.1, help="How long.")] = 10.0,
    as_json: JsonOption = False,
) -> None:
    """A learning daemon at 100 kHz, its Python paused at random: what grows, what is lost? Exit code 1 for a loss."""
    with tempfile.TemporaryDirectory(prefix="soak-") as folder:
        found = run_soak(Path(folder), minutes)
    put_out(as_json, found.document(), [soak_table(found), found.farewell], TABLE_WIDTH)
    if found.lost or found.repeated:
        raise typer.Exit(1)
