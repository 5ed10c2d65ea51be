"""The scenarios of time: the frames, which rule applies, what the service must make of it (docs/time.md)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from observer_rt.engine.stream.state import Reason, State
from tests.daemon import time_frames
from tests.daemon.time_frames import Clock, StampedFrame, batches, jitter, merged, observe, rare, send

RATE = 20e3
GRID = Clock(RATE)
OTHER = Clock(RATE, 13e-6, 50e-6)  # a third of a sample late, 50 ppm slow
DISTURBED = 1.2  # s, just after the needle has opened
RESTARTED = 1.25  # s
WORN = 0.2  # v_H
BARS = {20e3: (0.02, 1.2e-6), 50e3: (0.01, 0.5e-6)}  # of volume and rate [m3/s]: one clock has up to 1.5 %
STEEPEST = 12e-6  # m3/s from one sample to the next at 20 kHz, where a worn needle opens or shuts
LATER = 2.3  # s, by when clocks are known again

ONE_BASE = {"Line": 'message = "Line"', "Lift": 'message = "RailLift"', "Rail": 'message = "RailLift"'}
TWO_BASES = {
    "Line": 'message = "Line"',
    "Lift": 'message = "RailLift"\ntime_base = "other"',
    "Rail": 'message = "RailLift"\ntime_base = "other"',
}
STAMPS = dict.fromkeys(("Rail", "Lift", "Line"), 'message = "All"\nindex = ""')
NIBBLE = dict.fromkeys(("Rail", "Lift", "Line"), 'message = "All"\ncounter = "Nibble"')
PRESSURES = 'message = "RailLine"'
LIFT_ALONE = {"Line": PRESSURES, "Lift": 'message = "Lift"\ntime_base = "other"', "Rail": PRESSURES}
THREE_BASES = {
    "Line": 'message = "Line"',
    "Lift": 'message = "Lift"\ntime_base = "other"',
    "Rail": 'message = "RailSlow"\ntime_base = "third"',
}
THREE_COUNTED = {
    "Line": 'message = "LineOnly"\ncounter = "Count"',
    "Lift": 'message = "LiftOnly"\ncounter = "Count"',
    "Rail": 'message = "Rail"\ndelay_us = 34',
}

GOOD = (State.RUNNING_NOMINAL, Reason.NONE)
LEARNED = (State.ADAPTED, Reason.NONE)
# A rate that is not known sharply enough yet, within an injection.
NOT_SHARP = {(state, Reason.OUTSIDE_LEARNED_RANGE) for state in (State.RUNNING_NOMINAL, State.ADAPTED)}
TIME_BASE = (State.DEGRADED, Reason.TIME_BASE)
LOST = (State.DEGRADED, Reason.SAMPLES_LOST)
ANEW = (State.DEGRADED, Reason.DEVICE_RESTARTED)
STALE = (State.DEGRADED, Reason.INPUT_STALE)
INADEQUATE = (State.DEGRADED, Reason.MODEL_INADEQUATE)  # Straight lines between rare samples are not the rail.
CONTRADICTED = (State.DEGRADED, Reason.CONTRADICTED)


@dataclass(frozen=True)
class Scenario:
    """The frames, and the last state the service shows of them.

    shown: states between the disturbance and the end; restart [s]: of the line's index; wear: v_H, to be learned;
    volume_error, rmse, sample_error [m3/s]: limits for valid injections and samples.
    """

    name: str
    rule: str
    signals: dict[str, str]
    frames: Callable[[], Sequence[StampedFrame]]
    last: tuple[State, Reason] = GOOD
    shown: frozenset[tuple[State, Reason]] = frozenset({GOOD})
    restart: float | None = None
    rate: float = RATE
    wear: float = 0.0
    volume_error: float = 0.01
    rmse: float = 0.5e-6
    sample_error: float = 5e-6


def lift_alone(rate: float, drift: float) -> list[StampedFrame]:
    return merged(send("RailLine", Clock(rate), wear=WORN), send("Lift", Clock(rate, 0.3 / rate, drift), wear=WORN))


def three_clocks(rate: float, drift: float) -> list[StampedFrame]:
    rail = send("RailSlow", Clock(rate, 0.7 / rate, -drift), wear=WORN)
    return merged(send("Line", Clock(rate), wear=WORN), send("Lift", Clock(rate, 0.3 / rate, drift), wear=WORN), rail)


def worn(
    name: str, signals: dict[str, str], frames: Callable[[float, float], list[StampedFrame]], rate: float, ppm: float
) -> Scenario:
    """A worn injector that the service learns, two clocks running apart by `ppm`."""
    good = Scenario(
        f"{name} {rate / 1e3:g} kHz, {ppm:g} ppm, worn, learning", "2", signals, lambda: frames(rate, ppm * 1e-6)
    )
    volume, rmse = BARS[rate]
    good = replace(good, volume_error=volume, rmse=rmse, sample_error=STEEPEST)
    return replace(good, last=LEARNED, shown=frozenset({LEARNED}), rate=rate, wear=WORN)


def slow(lines: str) -> dict[str, str]:
    shared = 'message = "LineLift"'
    return {"Line": shared, "Lift": shared, "Rail": lines}


def without(frames: Sequence[StampedFrame], start: float, end: float) -> list[StampedFrame]:
    return [frame for frame in frames if not start <= frame.taken < end]


def overtaken(frames: Sequence[StampedFrame], after: float) -> list[StampedFrame]:
    """The first frame after `after` [s] comes behind its successor."""
    n = next(n for n, frame in enumerate(frames) if frame.taken > after)
    late = replace(frames[n], stamp_ns=frames[n + 1].stamp_ns + 20_000)
    return [*frames[:n], frames[n + 1], late, *frames[n + 2 :]]


def restarted(name: str, clock: Clock) -> list[StampedFrame]:
    return [*send(name, clock, end=RESTARTED - 0.03), *send(name, replace(clock, phase=RESTARTED), end=LATER)]


def asleep(frames: Sequence[StampedFrame]) -> list[StampedFrame]:
    wake = frames[0].stamp_ns + round((DISTURBED + 0.08) * 1e9)
    begin = frames[0].stamp_ns + round(DISTURBED * 1e9)
    return [replace(f, stamp_ns=wake) if begin < f.stamp_ns < wake else f for f in frames]


def clock_set(frames: Sequence[StampedFrame], step_ns: int) -> list[StampedFrame]:
    return [replace(f, stamp_ns=f.stamp_ns + step_ns) if f.taken > DISTURBED else f for f in frames]


def three_counted() -> list[StampedFrame]:
    """Three messages of one device, one after another on the bus, without an index."""
    rail = [replace(frame, stamp_ns=frame.stamp_ns + 20_000) for frame in send("Rail", GRID)]
    return merged(send("LineOnly", GRID), send("LiftOnly", GRID), rail)


ECU = Clock(1e3, 0.3e-3, 20e-6)
SLOW = 'message = "Rail"\ntime_base = "ecu"\nrate_hz = 1e3'
SCENARIOS = (
    Scenario("one base, jitter 300 us", "1", ONE_BASE, lambda: merged(
        send("Line", GRID, jitter(300e-6)), send("RailLift", GRID, jitter(300e-6)))),
    Scenario("skew 13 us", "2", TWO_BASES, lambda: merged(send("Line", GRID), send("RailLift", Clock(RATE, 13e-6)))),
    Scenario("skew 13 us, drift 50 ppm", "2", TWO_BASES, lambda: merged(send("Line", GRID), send("RailLift", OTHER))),
    Scenario("drift -150 and +100 ppm", "2", TWO_BASES, lambda: merged(
        send("Line", Clock(RATE, 0.0, -150e-6)), send("RailLift", Clock(RATE, 3e-6, 100e-6)))),
    Scenario("one frame in 20 late by up to 300 us", "2", TWO_BASES, lambda: merged(
        send("Line", GRID, rare(300e-6, 0.05)), send("RailLift", OTHER, rare(300e-6, 0.05)))),
    Scenario("every frame late by up to 200 us", "2", TWO_BASES, lambda: merged(
        send("Line", GRID, jitter(200e-6)), send("RailLift", OTHER, jitter(200e-6))),
        TIME_BASE, frozenset({TIME_BASE})),
    Scenario("batches of 1 ms", "2", TWO_BASES, lambda: merged(
        send("Line", GRID, batches(1e-3)), send("RailLift", OTHER, batches(1e-3))),
        TIME_BASE, frozenset({TIME_BASE})),
    Scenario("receiver's clock set by 5 ms", "2", TWO_BASES, lambda: clock_set(merged(
        send("Line", GRID, end=LATER), send("RailLift", OTHER, end=LATER)), 5_000_000),
        GOOD, frozenset({GOOD, LOST, TIME_BASE})),
    Scenario("other device loses one frame", "2, 5", TWO_BASES, lambda: merged(
        send("Line", GRID), without(send("RailLift", OTHER), DISTURBED, DISTURBED + 50e-6))),
    Scenario("other device loses 10 frames", "2, 5", TWO_BASES, lambda: merged(
        send("Line", GRID), without(send("RailLift", OTHER), DISTURBED, DISTURBED + 0.5e-3)),
        GOOD, frozenset({GOOD, LOST})),
    Scenario("other device silent for 60 ms", "2, 5", TWO_BASES, lambda: merged(
        send("Line", GRID), without(send("RailLift", OTHER), DISTURBED, DISTURBED + 0.06)),
        GOOD, frozenset({GOOD, LOST})),
    Scenario("other device falls silent", "2", TWO_BASES, lambda: merged(
        send("Line", GRID), without(send("RailLift", OTHER), DISTURBED, 9.0)), STALE),
    Scenario("line pressure falls silent", "2", TWO_BASES, lambda: merged(
        without(send("Line", GRID), DISTURBED, 9.0), send("RailLift", OTHER)), STALE),
    Scenario("two frames swapped", "5", TWO_BASES, lambda: merged(
        overtaken(send("Line", GRID), DISTURBED), send("RailLift", OTHER))),
    Scenario("other device restarts", "2, 5", TWO_BASES, lambda: merged(
        send("Line", GRID, end=LATER), restarted("RailLift", Clock(RATE, 0.0, 20e-6))),
        GOOD, frozenset({GOOD, LOST, TIME_BASE})),
    Scenario("line-pressure device restarts", "2, 5", TWO_BASES, lambda: merged(
        restarted("Line", GRID), send("RailLift", OTHER, end=LATER)),
        GOOD, frozenset({GOOD, ANEW, TIME_BASE}), RESTARTED),
    Scenario("no index: prompt", "3", STAMPS, lambda: send("All", GRID)),
    Scenario("no index: a frame lost", "3", STAMPS, lambda: without(send("All", GRID), DISTURBED, DISTURBED + 50e-6)),
    Scenario("no index: 17 frames lost", "3, 5", STAMPS, lambda: without(
        send("All", GRID), DISTURBED, DISTURBED + 0.85e-3), GOOD, frozenset({GOOD, LOST})),
    Scenario("no index, no counter: jitter 400 us", "3", STAMPS, lambda: send("All", GRID, jitter(400e-6)),
        TIME_BASE, frozenset({TIME_BASE})),
    Scenario("4-bit counter: jitter 400 us", "3", NIBBLE, lambda: send("All", GRID, jitter(400e-6)),
        GOOD, frozenset({GOOD, TIME_BASE})),
    Scenario("4-bit counter: jitter 400 us, 17 lost", "3, 5", NIBBLE, lambda: without(
        send("All", GRID, jitter(400e-6)), DISTURBED, DISTURBED + 0.85e-3), GOOD, frozenset({GOOD, LOST, TIME_BASE})),
    Scenario("8-bit counter: batches of 1 ms", "3",
        {name: lines.replace("Nibble", "Count") for name, lines in NIBBLE.items()},
        lambda: send("All", GRID, batches(1e-3))),
    Scenario("4-bit counter: two frames swapped", "3, 5", NIBBLE, lambda: overtaken(send("All", GRID), DISTURBED)),
    Scenario("no index: receiver asleep for 80 ms", "3", STAMPS, lambda: asleep(send("All", GRID, end=LATER)),
        GOOD, frozenset({GOOD, LOST, ANEW, TIME_BASE}), DISTURBED + 2 / RATE),
    Scenario("4-bit counter: device restarts", "3, 5", NIBBLE, lambda: restarted("All", GRID),
        GOOD, frozenset({GOOD, ANEW, TIME_BASE}), RESTARTED),
    Scenario("three counted messages", "1, 3", THREE_COUNTED, three_counted),
    Scenario("rail every 20th sample, same base", "4", slow('message = "RailSlow"\nrate_hz = 1e3'), lambda: merged(
        send("LineLift", GRID), send("RailSlow", Clock(1e3)))),
    Scenario("rail 1 kHz, jitter 200 us", "4", slow(SLOW), lambda: merged(
        send("LineLift", GRID), send("Rail", ECU, jitter(200e-6)))),
    Scenario("rail 100 Hz", "4", slow(SLOW.replace("1e3", "100")), lambda: merged(
        send("LineLift", GRID), send("Rail", replace(ECU, rate=100.0))), INADEQUATE, frozenset({INADEQUATE})),
    Scenario("rail 1 kHz silent for 60 ms", "4", slow(SLOW), lambda: merged(
        send("LineLift", GRID), without(send("Rail", ECU), DISTURBED, DISTURBED + 0.06)),
        GOOD, frozenset({GOOD, LOST, INADEQUATE, CONTRADICTED})),
    Scenario("rail 1 kHz falls silent", "4", slow(SLOW), lambda: merged(
        send("LineLift", GRID), without(send("Rail", ECU), DISTURBED, 9.0)), STALE, frozenset({GOOD, CONTRADICTED})),
    worn("lift alone", LIFT_ALONE, lift_alone, 20e3, 20),
    worn("lift alone", LIFT_ALONE, lift_alone, 20e3, 50),
    worn("lift alone", LIFT_ALONE, lift_alone, 20e3, 150),
    worn("three clocks", THREE_BASES, three_clocks, 20e3, 50),
    worn("lift alone", LIFT_ALONE, lift_alone, 50e3, 50),
    worn("three clocks", THREE_BASES, three_clocks, 50e3, 150),
)  # fmt: skip


def run(scenario: Scenario, folder: Path) -> time_frames.Outcome:
    bench = time_frames.write_time_bench(folder, scenario.rate, scenario.signals)
    grid = Clock(scenario.rate, 0.0, -150e-6 if "-150" in scenario.name else 0.0)
    return observe(bench, scenario.frames(), grid, scenario.restart, scenario.wear != 0.0, scenario.wear)


@dataclass(frozen=True)
class Figures:
    valid: int
    volume_error: float
    rmse: float
    sample_error: float

    @classmethod
    def of(cls, outcome: time_frames.Outcome) -> "Figures":
        valid = [injection for injection in outcome.injections() if injection.is_valid]
        return cls(
            len(valid),
            max((abs(injection.volume_error) for injection in valid), default=0.0),
            max((injection.rmse for injection in valid), default=0.0),
            float(np.abs(outcome.error[outcome.valid]).max(initial=0.0)),
        )
