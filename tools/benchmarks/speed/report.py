"""A run of `tools/bench speed` as tables and as a document."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from rich.console import Console
from rich.table import Table

from tools.benchmarks.figure import figures_table
from tools.benchmarks.speed.bars import figures
from tools.benchmarks.speed.evaluated import EvaluateTimes
from tools.benchmarks.speed.injectors import InjectorsRow
from tools.benchmarks.speed.measure import Speed
from tools.benchmarks.speed.roundtrip import ECHO, RoundTrips
from tools.benchmarks.speed.training import USUAL, TrainingTimes


def print_speed(speed: Speed, console: Console) -> None:
    """Every table there is something for."""
    console.print(figures_table(figures(speed), "speed", speed.load))
    if speed.roundtrips:
        console.print(_round_trip_table(speed.roundtrips))
        for party, text in speed.roundtrips.said.items():
            if "us a frame" in text:
                console.print(f"{party}, {text}", highlight=False)
    if speed.sustained:
        shares = ", ".join(f"{share:.2f}" for share in speed.sustained.thread_shares[:4])
        text = f"socket pair: {speed.sustained.latency}; busiest threads {shares} of a core"
        console.print(f"{text}; {speed.sustained.farewell}", highlight=False)
    if speed.sample:
        times = speed.sample
        text = f"open sample: {times.ours:.2f} us, in C {times.in_c:.2f}, whole step {times.whole:.2f}"
        console.print(f"{text}; the same rates to {times.largest_difference:.1e}", highlight=False)
    if speed.evaluate:
        console.print(_evaluate_table(speed.evaluate))
    if speed.training:
        console.print(_training_table(speed.training))
        ours, theirs = speed.training.costs
        text = f"J of {USUAL} samples falls to {ours:.1e} and {theirs:.1e} of what it was"
        (values, gradients), (_, at_once) = speed.training.evaluations
        text += f", ours by {values} values and {gradients} gradients, scipy by {at_once} of both"
        default = f"an event of the default training takes {speed.training.default_ms:.1f} ms"
        console.print(f"{text}; {default}", highlight=False)
    if speed.startup:
        started = speed.startup
        parts = (
            f"{started.imports_s:.1f} s until its first word, {started.warm_cpu_s:.1f} s of processor time"
        )
        cold = "" if started.cold_cpu_s is None else f"; cold {started.cold_cpu_s:.0f} s"
        console.print(f"start-up: of the warm one {parts}{cold}", highlight=False)
    if speed.scaling:
        table = Table("grows", "to", "us a sample", title="scaling", title_justify="left")
        for row in speed.scaling:
            table.add_row(row.what, f"{row.value:g}", f"{row.us_a_sample:.2f}")
        console.print(table)
    if speed.injectors:
        console.print(_injectors_table(speed.injectors))


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
