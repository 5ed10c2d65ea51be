"""After a fault of an input, of any shape and length, injections are valid again with the third one, and right."""

from collections.abc import Callable, Sequence
from functools import cache

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from observer_rt.config.bench import load_bench
from observer_rt.config.injector import SamplingConfig
from observer_rt.config.signals import Role
from observer_rt.desk.evaluation.evaluate import evaluate_stream
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.stream.state import Reason, State
from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.stream import HeldSignals
from observer_rt.foundation.units import MILLIGRAM, MILLISECOND
from tests.benches import SAMPLE_RATE
from tests.device import core_of, frames_of, hand, run, simulated
from tests.input_faults import SHAPES, InputFault

INJECTIONS, PERIOD = 24, 0.05  # s
FIRST = 0.15  # s
BEGIN = FIRST + 5 * PERIOD  # s, when some have been valid
AFTER = 4  # injections after the fault, at least
RECOVERED = 3  # injections
WRONG, LEAST = 0.03, 0.5 * MILLIGRAM  # of the mass, and of any: a burst of noise may open a needle
AS_RECORDED = 1 * MILLISECOND * SAMPLE_RATE  # samples by which its window may begin elsewhere
MODEST = 8  # examples: each observes a second and a half
BENCH = load_bench().with_sections(sampling=SamplingConfig(rate_hz=SAMPLE_RATE))

FAULTS = st.builds(
    lambda role, shape, begin, length, size, pace, seed: InputFault(
        role, shape, begin, begin + length, 10**size, pace, seed
    ),
    st.sampled_from(Role),
    st.sampled_from(sorted(SHAPES)),
    st.floats(BEGIN - 0.5 * PERIOD, BEGIN + 0.5 * PERIOD),
    st.floats(5 * MILLISECOND, (INJECTIONS - AFTER - 6) * PERIOD),
    st.floats(-2.0, 0.0),
    st.sampled_from([50.0, 60.0, 150.0, 400.0]),
    st.integers(0, 1000),
)


def worn() -> Recording:
    return simulated(INJECTIONS, 0.3, (60e6, 100e6, 140e6))


def live(recording: Recording) -> Sequence[InjectionReport]:
    return run(BENCH, frames_of(BENCH, recording)).reports


def in_a_file(recording: Recording) -> Sequence[InjectionReport]:
    (evaluation,), _ = evaluate_stream(BENCH, [HeldSignals(recording)])
    starts = [result.start for result in evaluation.injections]
    assert starts == sorted(starts)
    return evaluation.reports


@cache
def undisturbed(way: Callable[[Recording], Sequence[InjectionReport]]) -> dict[int, float]:
    """Masses [kg] of the injections, by sample index."""
    return {report.start_index: report.mass for report in way(worn())}


@pytest.mark.parametrize("way", [live, in_a_file])
@settings(max_examples=MODEST, derandomize=True)
@given(fault=FAULTS)
@example(fault=InputFault(Role.NEEDLE_LIFT, "floating", BEGIN - 0.02, BEGIN + 0.48, 0.2, 50.0, 1))
@example(fault=InputFault(Role.LINE_PRESSURE, "hum", BEGIN - 0.02, BEGIN + 0.48, 0.05, 50.0, 1))
@example(fault=InputFault(Role.RAIL_PRESSURE, "bursts", 0.388, 0.648, 0.26, 60.0, 283))
@example(fault=InputFault(Role.RAIL_PRESSURE, "noise", 0.4156, 0.828, 0.0365, 150.0, 897))
@example(fault=InputFault(Role.LINE_PRESSURE, "hum", 0.40628, 1.0237, 0.01915, 50.0, 808))
def test_the_third_injection_after_a_fault_is_valid(
    way: Callable[[Recording], Sequence[InjectionReport]], fault: InputFault
) -> None:
    masses = undisturbed(way)
    valid = [report for report in way(fault.of(worn())) if report.valid]
    found: dict[int, InjectionReport] = {}
    for report in valid:
        start = min(masses, key=lambda index: abs(index - report.start_index))
        is_one = abs(start - report.start_index) < AS_RECORDED
        assert report.mass == pytest.approx(masses[start] if is_one else 0.0, rel=WRONG, abs=LEAST)
        found[start] = report
    after = [start for start in masses if start > fault.end * SAMPLE_RATE]
    assert set(after[RECOVERED - 1 :]) <= set(found)


DEAD = 1.0  # s, up to which the lift is nothing but the noise of its amplifier


@pytest.mark.parametrize("begin", [0.0, BEGIN])
def test_a_lift_that_never_opens_while_the_line_falls_is_named(begin: float) -> None:
    recording = InputFault(Role.NEEDLE_LIFT, "dead", begin, DEAD, 7e-4, 50.0, 3).of(worn())
    frames = frames_of(BENCH, recording)
    core = core_of(BENCH)
    hand(core, [frame for frame in frames if frame.time < DEAD])
    assert core.state == (State.DEGRADED, Reason.LIFT_DEAD)
    hand(core, [frame for frame in frames if frame.time >= DEAD])
    assert core.state == (State.ADAPTED, Reason.NONE)
