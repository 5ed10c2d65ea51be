"""`tools/bench history`: hours of bus time through the service at speed; does anything grow, go back, or get lost?"""

import gc
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import psutil
import typer

from observer_rt.bus.links.link import BusFrame, Frame, block_of
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.engine.reports.news import Notes
from observer_rt.engine.service.core import Core
from observer_rt.engine.service.messages import Counters
from observer_rt.files.replay.framing import Framer, windows
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.units import MILLISECOND
from tests.observed_plants import bench_at
from tools.benchmarks.command_line import JsonOption, ModelOption, app, tracked
from tools.benchmarks.report import Columns, put_out, table_of
from tools.benchmarks.scoring import part_of, worn_injector

SAMPLE_RATE = 100e3  # Hz: the index of 32 bits comes round after 11.9 h
PRESSURES = (60e6, 100e6, 140e6)  # Pa
SPACING = 40 * MILLISECOND
RECORDED = 12  # injections, again and again
LOOKS = 48
SETTLED = 8  # looks, after which memory should not grow any more
FLAT = 1.0  # MiB an hour
_MEBIBYTE = 1 << 20
_HOUR = 3600.0  # s


@dataclass(frozen=True)
class Look:
    """At an hour of bus time: memory [MiB]; injections so far: sent, reported, valid, twice or out of turn."""

    hour: float
    memory: float
    sent: int
    reported: int
    valid: int
    out_of_turn: int
    gone_back: tuple[str, ...]
    """Counters that are smaller than they were."""


@dataclass(frozen=True)
class History:
    """All looks; counters: at the end."""

    looks: tuple[Look, ...]
    counters: Counters

    @property
    def growth(self) -> float:
        """Of the memory [MiB an hour], by a straight line through it once it has settled."""
        settled = self.looks[SETTLED:]
        return float(np.polyfit([each.hour for each in settled], [each.memory for each in settled], 1)[0])

    @property
    def missed(self) -> list[str]:
        """What should not be."""
        last = self.looks[-1]
        found = {
            f"memory grows by {self.growth:.2f} MiB an hour": self.growth > FLAT,
            f"{last.sent - last.reported} injections not reported": last.reported != last.sent,
            f"{last.out_of_turn} reported twice or out of turn": last.out_of_turn > 0,
            f"counters went back: {', '.join(last.gone_back)}": bool(last.gone_back),
            f"{self.counters.lost_samples} samples lost": self.counters.lost_samples > 0,
            f"{self.counters.restarts} restarts": self.counters.restarts > 0,
        }
        return [text for text, is_so in found.items() if is_so]


def run_history(hours: float, period: float, model: Path | None) -> History:
    """An injection every `period` [s], in windows with the index going on between them; model: an injector file."""
    bench = bench_at(SAMPLE_RATE, model)
    bus, notes, looks = map_bus(bench), Notes(), []
    core, framer = Core(bench.injector, bus, listeners=[notes]), Framer(bus)
    parts = _injections(model)
    count, before = round(hours * _HOUR / period), core.counters
    reported = valid = out_of_turn = 0
    gone_back: dict[str, None] = {}
    for number in tracked(range(1, count + 1), "history"):
        part = parts[(number - 1) % len(parts)]
        _send(core, framer, part, (number - 1) * period)
        framer.skip(round(period * SAMPLE_RATE) - part.samples)
        for report in notes.injections:
            reported += 1
            out_of_turn += report.number != reported
            valid += report.valid
        notes.injections.clear()
        if number * LOOKS // count == (number - 1) * LOOKS // count and number < count:
            continue
        if number == count:
            core.finish()
            reported += len(notes.injections)
        now = core.counters
        gone_back |= {name: None for name, value in vars(now).items() if value < getattr(before, name)}
        before = now
        gc.collect()
        hour, memory = number * period / _HOUR, psutil.Process().memory_info().rss / _MEBIBYTE
        looks.append(Look(hour, memory, number, reported, valid, out_of_turn, tuple(gone_back)))
    return History(tuple(looks), core.counters)


@app.command(epilog="Examples: tools/bench history; tools/bench history --hours 1 --model fitted.toml --json")
def history(
    hours: Annotated[float, typer.Option(min=0.1, help="Of bus time.")] = 24.0,
    period: Annotated[float, typer.Option(min=0.05, help="Seconds from one injection to the next.")] = 1.0,
    model: ModelOption = None,
    as_json: JsonOption = False,
) -> None:
    """A day of injections in windows through the service, at speed: memory, counters, every injection once."""
    found = run_history(hours, period, model)
    looks = {f"{each.hour:.1f}": each for each in found.looks[:: max(1, len(found.looks) // 24)]}
    table = table_of(f"memory grows by {found.growth:.3f} MiB an hour", "hour", looks, _COLUMNS)
    document = {
        "figures": {"growth_mib_per_h": found.growth, **asdict(found.looks[-1])},
        "details": {
            "looks": [asdict(each) for each in found.looks],
            "counters": asdict(found.counters),
            "violations": found.missed,
        },
    }
    put_out(as_json, document, [table, *(f"missed: {text}" for text in found.missed)])


def _injections(model: Path | None) -> Sequence[Recording]:
    """Windows round injections of a worn injector."""
    schedule = make_schedule(PRESSURES, RECORDED, SPACING, [1.2e-3])
    injector = bench_at(SAMPLE_RATE, model).injector.parameters
    whole = worn_injector(schedule, SAMPLE_RATE, injector=injector).recording
    return [part_of(whole, span) for span in windows(whole)]


def _send(core: Core, framer: Framer, part: Recording, begin: float) -> None:
    given = [
        BusFrame(
            each.bus, Frame(each.frame_id, each.payload, round(1e9 * (begin + each.time)), each.is_extended)
        )
        for each in framer.frames(part, windows(part))
    ]
    core.handle_many(block_of(given))


_COLUMNS: Columns[Look] = {
    "MiB": "{.memory:.1f}",
    "injections sent": "{.sent}",
    "reported": "{.reported}",
    "valid": "{.valid}",
}
