"""A run of `tools/bench speed` as figures beside their bars, as tables, as a document and as a histogram."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray
from rich.table import Table

from observer_rt.foundation.units import MICROSECOND
from tools.benchmarks.figures import COLOURS
from tools.benchmarks.report import Figure, Shown, figures_table
from tools.benchmarks.speed.core_alone import ARRAYS, CAN_LOG, MDF4, PARQUET, EvaluateTimes
from tools.benchmarks.speed.injectors import NUMBERS, InjectorsRow
from tools.benchmarks.speed.roundtrip import BUSY, ECHO, LEAN, OURS, PACES, PEER, RoundTrips
from tools.benchmarks.speed.sample import SampleTimes
from tools.benchmarks.speed.scaling import Row, exponent
from tools.benchmarks.speed.sustained import Startup, Sustained
from tools.benchmarks.speed.traffic import SAMPLES
from tools.benchmarks.speed.training import USUAL, TrainingTimes

EVALUATE_BARS = {ARRAYS: 0.8, PARQUET: 0.5, MDF4: 0.5, CAN_LOG: 0.5}
"""Of the core's speed, by what is evaluated."""
_STYLE = {OURS: 0, ECHO: 1, PEER: 2, LEAN: 3, BUSY: 4}
_BINS = 60


@dataclass(frozen=True)
class Speed:
    """What was measured; None: was not. load: of the machine in the last minute, before and after."""

    load: tuple[float, float]
    sustained: Sustained | None = None
    roundtrips: RoundTrips | None = None
    sample: SampleTimes | None = None
    evaluate: EvaluateTimes | None = None
    training: TrainingTimes | None = None
    startup: Startup | None = None
    scaling: tuple[Row, ...] = ()
    injectors: tuple[InjectorsRow, ...] = ()


def figures(speed: Speed) -> list[Figure]:
    """All of them, None for those not measured."""
    parts = (_round_trip, _sustained, _sample, _evaluate, _training, _rest)
    return [figure for part in parts for figure in part(speed)]


def _round_trip(speed: Speed) -> Iterator[Figure]:
    found = speed.roundtrips
    echo = "C echo, worst pace"
    yield Figure("roundtrip_p50_vs_c_echo", found.ratio(OURS, ECHO) if found else None, echo, 2.0)
    yield Figure("roundtrip_busy_p50_vs_c_echo", found.ratio(BUSY, ECHO) if found else None, echo, 2.0)
    yield Figure(
        "roundtrip_busy_p50_vs_quiet", found.ratio(BUSY, OURS) if found else None, "ours, Python quiet", 1.1
    )
    excess = "C echo's own, in p50 of ours"
    yield Figure("roundtrip_p999_excess", found.excess(OURS) if found else None, excess, 2.0)
    yield Figure("roundtrip_busy_p999_excess", found.excess(BUSY) if found else None, excess, 2.0)
    peer = "python-can, cantools, numpy; paces it keeps"
    yield Figure(
        "roundtrip_speedup_vs_python_can", found.speedup(PEER) if found else None, peer, at_least=5.0
    )
    lean = "the same without an observer"
    yield Figure("roundtrip_speedup_vs_python_can_lean", found.speedup(LEAN) if found else None, lean)


def _sustained(speed: Speed) -> Iterator[Figure]:
    found = speed.sustained
    yield Figure("sustained_khz", found.sustained_khz if found else None, "100 kHz sent", at_least=99.9)
    yield Figure("cpu_share", found.cpu_share if found else None, "one core", 0.5)
    yield Figure("lost_samples", float(found.lost_samples) if found else None, "all sent", 0.0)
    yield Figure("sustained_p999_us", found.latency.p999 if found else None, "")


def _sample(speed: Speed) -> Iterator[Figure]:
    found = speed.sample
    yield Figure("sample_vs_c", found.ratio if found else None, "C -O3, same tanh", 1.3)
    yield Figure(
        "whole_step_vs_c", found.whole / found.in_c if found else None, "the same C: no events, no statistics"
    )


def _evaluate(speed: Speed) -> Iterator[Figure]:
    found = speed.evaluate
    for source, bar in EVALUATE_BARS.items():
        name = f"evaluate_{source.replace(' ', '_')}_vs_core"
        value = found.share(source) if found else None
        yield Figure(name, value, "the compiled core alone, nothing learned", at_least=bar)


def _training(speed: Speed) -> Iterator[Figure]:
    found = speed.training
    yield Figure(
        "training_speedup_vs_scipy", found.ratio if found else None, "scipy BFGS, same gradient", at_least=3.0
    )
    yield Figure("training_exponent", found.exponent if found else None, "1: linear in samples", 1.1)


def _rest(speed: Speed) -> Iterator[Figure]:
    started = speed.startup
    yield Figure("ready_warm_s", started.warm_s if started else None, "", 3.0)
    yield Figure("ready_cold_s", started.cold_s if started else None, "", 20.0)
    yield Figure("memory_mib", started.memory_mib if started else None, "")
    yield Figure("samples_exponent", exponent(speed.scaling) if speed.scaling else None, "1: linear", 1.1)
    most = speed.injectors[-1] if speed.injectors else None
    what = f"{NUMBERS[-1]} injectors, windows, learning"
    yield Figure("injectors_cpu_share", most.cpu_share if most else None, f"one core; {what}", 1.0)
    yield Figure("injectors_lost_samples", float(most.lost_samples) if most else None, what, 0.0)
    yield Figure("injectors_not_judged", float(most.injections - most.judged) if most else None, what, 0.0)
    yield Figure("block_samples", SAMPLES, "")
    yield Figure("substeps", float(speed.sample.substeps) if speed.sample else None, "")


def shown(speed: Speed) -> Iterator[Shown]:
    """What there is something for."""
    yield figures_table(figures(speed), "speed", speed.load)
    if speed.roundtrips:
        yield _round_trip_table(speed.roundtrips)
        for party, text in speed.roundtrips.said.items():
            if "us a frame" in text:
                yield f"{party}, {text}"
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
    if speed.training:
        yield _training_table(speed.training)
        ours, theirs = speed.training.costs
        text = f"J of {USUAL} samples falls to {ours:.1e} and {theirs:.1e} of what it was"
        (values, gradients), (_, at_once) = speed.training.evaluations
        text += f", ours by {values} values and {gradients} gradients, scipy by {at_once} of both"
        default = f"an event of the default training takes {speed.training.default_ms:.1f} ms"
        yield f"{text}; {default}"
    if speed.startup:
        started = speed.startup
        parts = (
            f"{started.imports_s:.1f} s until its first word, {started.warm_cpu_s:.1f} s of processor time"
        )
        cold = "" if started.cold_cpu_s is None else f"; cold {started.cold_cpu_s:.0f} s"
        yield f"start-up: of the warm one {parts}{cold}"
    if speed.scaling:
        table = Table("grows", "to", "us a sample", title="scaling", title_justify="left")
        for row in speed.scaling:
            table.add_row(row.what, f"{row.value:g}", f"{row.us_a_sample:.2f}")
        yield table
    if speed.injectors:
        yield _injectors_table(speed.injectors)


def speed_document(speed: Speed) -> dict[str, Any]:
    """`figures` by name, `details` of what was measured."""
    return {
        "figures": {each.name: each.value for each in figures(speed)} | {"link": link_of(speed)},
        "details": {
            "load": speed.load,
            "missed": [each.name for each in figures(speed) if each.is_met is False],
            "roundtrip": speed.roundtrips and speed.roundtrips.document(),
            "sustained": speed.sustained and speed.sustained.document(),
            "sample": speed.sample and asdict(speed.sample),
            "evaluate": speed.evaluate and asdict(speed.evaluate),
            "training": speed.training and asdict(speed.training),
            "startup": speed.startup and asdict(speed.startup),
            "scaling": [asdict(row) for row in speed.scaling],
            "injectors": [asdict(row) for row in speed.injectors],
        },
    }


def link_of(speed: Speed) -> str | None:
    """Where the round trip was measured."""
    return speed.roundtrips.link if speed.roundtrips else None


def _round_trip_table(found: RoundTrips) -> Table:
    title = f"round trip on {found.link}: p50 / p99 / p99.9 (answers)"
    columns = ("pace", "", "needle open", "x echo", "all", "lost samples")
    table = Table(*columns, title=title, title_justify="left")
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
    columns = ("", "clock", "of the core's speed", "processor", "of the core's")
    table = Table(*columns, title=title, title_justify="left")
    table.add_row("compiled core alone", f"{times.core.wall:.2f}", "", f"{times.core.processor:.2f}", "")
    for source, cost in times.whole.items():
        shares = f"{100 * times.share(source):.0f} %", f"{100 * times.processor_share(source):.0f} %"
        table.add_row(source, f"{cost.wall:.2f}", shares[0], f"{cost.processor:.2f}", shares[1])
    return table


def _injectors_table(rows: Sequence[InjectorsRow]) -> Table:
    title = "injectors in one daemon, windows of 100 kHz, 25 injections a second each"
    columns = ("injectors", "CPU", "lost samples", "injections", "judged", "learned from", "of these late")
    table = Table(*columns, title=title, title_justify="left")
    for each in rows:
        counts = (each.lost_samples, each.injections, each.judged, each.learned, each.late)
        table.add_row(str(each.injectors), f"{each.cpu_share:.2f}", *map(str, counts))
    return table


def _training_table(times: TrainingTimes) -> Table:
    table = Table("samples", "ours", "scipy", title="30 epochs, ms", title_justify="left")
    for samples, ms in times.ours.items():
        table.add_row(str(samples), f"{ms:.2f}", f"{times.scipy[samples]:.2f}")
    return table


def save_histograms(speed: Speed, folder: Path) -> Path | None:
    """Share of the answers by latency, a panel for each pace and one for the socket pair; None without any."""
    panels: dict[str, Mapping[str, NDArray[np.float64]]] = {}
    if speed.roundtrips:
        named = speed.roundtrips.latencies
        for pace in PACES:
            of_pace = {party: named[f"{pace}, {party}"] for party in _STYLE}
            panels[f"round trip on {speed.roundtrips.link}, needle open, a frame every {pace}"] = of_pace
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


def _panel(axis: Axes, title: str, found: Mapping[str, NDArray[np.float64]]) -> None:
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
