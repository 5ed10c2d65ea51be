"""Devices with clocks of their own, a bus that delays, loses and reorders, and what the core makes of it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

import cantools
import numpy as np
from numpy.typing import NDArray

from observer_rt.config.bench import load_injector
from observer_rt.desk.simulation.plant import Truth, run_plant
from observer_rt.desk.simulation.schedule import make_schedule, strokes
from observer_rt.desk.simulation.simulate import LIFT, PRESSURE, Quantisation, SimulatedNoise
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.service.core import Core
from observer_rt.engine.stream.state import Reason, State
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.effects import effective_model, sized
from tests.benches import own_bench
from tests.device import Notes, core_of

EPOCH = 1_700_000_000_000_000_000  # ns, of the receiver's clock
PLANT_RATE = 200e3
PERIOD = 0.05  # s between events
FIRST = 0.15  # s
LEAD = 1e-3  # s, by which the report of an injection may begin before it
INJECTIONS = 44
END = 1.5  # s of most scenarios
DIP = 2e6  # Pa the rail pressure falls by with an injection
RECOVERY = 0.01  # s
ON_BUS = 16e-6  # s a frame takes
ROWS = 1000  # taken from the core at once
INDEX = ' SG_ SampleIndex : 0|32@1+ (1,0) [0|0] "" Daq'
COUNT = ' SG_ Count : 0|8@1+ (1,0) [0|0] "" Daq'
NIBBLE = ' SG_ Nibble : 8|4@1+ (1,0) [0|0] "" Daq'


def message(number: int, name: str, *signals: str) -> str:
    return "\n".join([f"BO_ {number} {name}: 8 Daq", *signals])


def pressure(name: str, bit: int) -> str:
    return f' SG_ {name} : {bit}|16@1+ (0.005,-10) [0|0] "MPa" Daq'


def lift(bit: int) -> str:
    return f' SG_ Lift : {bit}|16@1+ (0.01,-50) [0|0] "um" Daq'


DATABASE = f"""VERSION ""
BU_: Daq
{message(512, "All", COUNT, NIBBLE, pressure("Rail", 16), lift(32), pressure("Line", 48))}
{message(513, "Line", INDEX, pressure("Line", 32))}
{message(514, "RailLift", INDEX, pressure("Rail", 32), lift(48))}
{message(515, "LineLift", INDEX, pressure("Line", 32), lift(48))}
{message(520, "Lift", INDEX, lift(32))}
{message(521, "RailLine", INDEX, pressure("Rail", 32), pressure("Line", 48))}
{message(516, "Rail", pressure("Rail", 32))}
{message(519, "RailSlow", INDEX, pressure("Rail", 32))}
{message(517, "LiftOnly", lift(32), COUNT)}
{message(518, "LineOnly", pressure("Line", 32), COUNT)}
"""
MESSAGES = {message.name: message for message in cantools.database.load_string(DATABASE, "dbc").messages}
ROLE_OF = {"Rail": "rail_pressure", "Lift": "needle_lift", "Line": "line_pressure"}


@cache
def plant(wear: float = 0.0) -> tuple[EffectiveModel, Truth]:
    """An injector whose rail dips with every injection, without noise, at PLANT_RATE; wear: v_H of its orifices."""
    parameters = load_injector()
    model = effective_model(parameters, [sized("orifice_area", v_H=wear)] if wear else ())
    schedule = make_schedule([100e6], INJECTIONS, PERIOD, [1.1e-3])
    time = np.arange(round(schedule.duration * PLANT_RATE) + 1) / PLANT_RATE
    rail = schedule.rail_pressure(time)
    for number in range(INJECTIONS):
        since = time - (FIRST + number * PERIOD)
        rail -= np.where(
            since > 0, DIP * np.minimum(since / 1e-3, 1) * np.exp(-np.maximum(since - 1e-3, 0) / RECOVERY), 0
        )
    return model, run_plant(model, strokes(schedule, parameters), time, rail)


@dataclass(frozen=True)
class Clock:
    """When a device takes its n-th sample: phase [s], drift against the receiver's clock."""

    rate: float
    phase: float = 0.0
    drift: float = 0.0

    def times(self, end: float) -> NDArray[np.float64]:
        interval = (1.0 + self.drift) / self.rate
        return np.asarray(self.phase + interval * np.arange(int((end - self.phase) / interval)))

    def time_of(self, index: NDArray[np.int64]) -> NDArray[np.float64]:
        return np.asarray(self.phase + index * (1.0 + self.drift) / self.rate)


@dataclass(frozen=True)
class StampedFrame:
    taken: float
    stamp_ns: int
    frame_id: int
    payload: bytes


Delays = Callable[[NDArray[np.float64], np.random.Generator], NDArray[np.float64]]


def prompt(taken: NDArray[np.float64], _: np.random.Generator) -> NDArray[np.float64]:
    """No jitter: every frame 150 us after its sample."""
    return taken + 150e-6


def jitter(width: float) -> Delays:
    return lambda taken, random: _one_by_one(taken + 150e-6 + random.uniform(0.0, width, taken.size))


def batches(period: float) -> Delays:
    """A USB adapter that hands over what came every `period` [s]."""
    return lambda taken, _: np.asarray(np.ceil((taken + 150e-6) / period) * period)


def rare(width: float, share: float) -> Delays:
    def delays(taken: NDArray[np.float64], random: np.random.Generator) -> NDArray[np.float64]:
        late = random.random(taken.size) < share
        return _one_by_one(taken + 150e-6 + np.where(late, random.uniform(0.0, width, taken.size), 0.0))

    return delays


def _one_by_one(come: NDArray[np.float64]) -> NDArray[np.float64]:
    earliest = ON_BUS * np.arange(come.size)
    return np.asarray(np.maximum.accumulate(come - earliest) + earliest)


def send(name: str, clock: Clock, delays: Delays = prompt, end: float = END, wear: float = 0.0) -> list[StampedFrame]:
    _, truth = plant(wear)
    taken = clock.times(end)
    random = np.random.default_rng(MESSAGES[name].frame_id)
    noise = SimulatedNoise()

    def measured(signal: NDArray[np.float64], sigma: float, codes: Quantisation, unit: float) -> NDArray[np.float64]:
        return codes.apply(np.interp(taken, truth.time, signal) + random.normal(0.0, sigma, taken.size)) / unit

    count = np.arange(taken.size)
    values: dict[str, NDArray[np.float64] | NDArray[np.int64]] = {
        "Rail": measured(truth.rail_pressure, noise.rail_pressure, PRESSURE, MEGAPASCAL),
        "Lift": measured(truth.needle_lift, noise.needle_lift, LIFT, MICROMETRE),
        "Line": measured(truth.line_pressure, noise.line_pressure, PRESSURE, MEGAPASCAL),
        "SampleIndex": count,
        "Count": count % 256,
        "Nibble": count % 16,
    }
    message = MESSAGES[name]
    words = np.zeros(taken.size, "<u8")
    for signal in message.signals:
        raw = np.rint((values[signal.name] - signal.offset) / signal.scale)
        words |= raw.astype("<u8") << np.uint64(signal.start)
    stamps = delays(taken, random)
    return [
        StampedFrame(float(taken[n]), EPOCH + round(float(stamps[n]) * 1e9), message.frame_id, words[n].tobytes())
        for n in range(taken.size)
    ]


def merged(*streams: Sequence[StampedFrame]) -> list[StampedFrame]:
    return sorted((frame for stream in streams for frame in stream), key=lambda frame: frame.stamp_ns)


def write_time_bench(folder: Path, rate: float, signals: dict[str, str]) -> Path:
    """A bench file: for each signal name of the database the message and further lines."""
    roles = {ROLE_OF[name]: f'signal = "{name}"\n{lines}' for name, lines in signals.items()}
    return own_bench(folder, DATABASE, roles, f"[sampling]\nrate_hz = {rate}\n[link]\nbit_rate = 8e6\n")


@dataclass(frozen=True)
class EstimatedInjection:
    """Relative error of volume, RMSE [m3/s] of rates; is_valid: so was its report, and every sample that is sharp."""

    number: int
    is_valid: bool
    volume_error: float
    rmse: float


@dataclass
class Outcome:
    core: Core
    interval: float  # s
    times: NDArray[np.float64]  # s, when the samples were taken
    rows: NDArray[np.void]
    truth: Truth
    reports: list[InjectionReport]
    frames: list[bytes] = field(default_factory=list)

    @property
    def valid(self) -> NDArray[np.bool_]:
        return np.asarray(self.rows["valid"])

    @property
    def error(self) -> NDArray[np.float64]:
        true = np.interp(self.times, self.truth.time, self.truth.injection_rate)
        return np.asarray(self.rows["injection_rate"] - true)

    def states(self, start: float, end: float) -> set[tuple[State, Reason]]:
        part = self.rows[(self.times >= start) & (self.times < end)]
        return {(State(int(row["state"])), Reason(int(row["reason"]))) for row in part}

    def injections(self) -> list[EstimatedInjection]:
        truth, error = self.truth, self.error
        refused = np.array([self.times[report.start_position] for report in self.reports if not report.valid])
        injections = []
        for number in range(INJECTIONS):
            start = FIRST + number * PERIOD
            inside = (self.times >= start) & (self.times < start + 6e-3)
            rows, times = self.rows[inside], self.times[inside]
            if len(rows) < 0.99 * 6e-3 / self.interval or np.isnan(rows["injection_rate"]).any():
                continue
            grid = (truth.time >= times[0]) & (truth.time <= times[-1])
            true = np.trapezoid(truth.injection_rate[grid], truth.time[grid])
            volume = np.trapezoid(rows["injection_rate"], times)
            is_refused = np.any((refused >= start - LEAD) & (refused < start + 6e-3))
            is_valid = not is_refused and set(rows["reason"]) <= {Reason.NONE, Reason.OUTSIDE_LEARNED_RANGE}
            rmse = float(np.sqrt(np.mean(error[inside & self.valid if is_valid else inside] ** 2)))
            injections.append(EstimatedInjection(number, is_valid, float(volume / true - 1.0), rmse))
        return injections


def observe(
    bench: Path,
    frames: Sequence[StampedFrame],
    grid: Clock,
    restart: float | None = None,
    learning: bool = False,
    wear: float = 0.0,
) -> Outcome:
    """Frames through a core; `grid` is the clock of the line pressure, which began anew at `restart` [s]."""
    notes = Notes()
    core = core_of(bench, learning=learning, listeners=[notes])
    rows, sent, seen = [], [], 0
    for frame in [*frames, None]:
        out = core.handle(frame.frame_id, False, frame.payload, frame.stamp_ns) if frame else core.finish()
        sent += [f.payload for f in out]
        if core.processed >= seen + ROWS or frame is None:
            rows.append(core.rows(seen, core.processed))
            seen = core.processed
    table = np.concatenate(rows)
    times = grid.time_of(table["index"])
    if restart is not None:
        begins = np.flatnonzero(np.diff(table["index"]) < 0)
        assert len(begins) == 1
        times[begins[0] + 1 :] = replace(grid, phase=restart).time_of(table["index"][begins[0] + 1 :])
    return Outcome(core, 1.0 / grid.rate, times, table, plant(wear)[1], notes.injections, sent)
