"""Commands without openings, openings without commands, and what must not look like one: losses, pauses, restarts."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from observer_rt.bus.links.link import BusFrame, Frame, block_of
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.recording.replay.framing import TimedFrame
from observer_rt.service.compiled.input_memory import READINGS
from observer_rt.service.core.core import Core
from observer_rt.simulation.schedule import Shot
from tests.benches import SAMPLE_RATE
from tests.device import damaged, later, merged, run
from tests.service.pulse_bench import Told, pulse_bench
from tests.service.pulse_frames import (
    blocks,
    commands,
    cyclic,
    duration_frame,
    durations,
    index_at,
    injected,
    level_frame,
    misfired,
    on_change,
    safe_durations,
    samples,
    watch,
)

PILOT_AND_MAIN = (Shot(0.3e-3, -1.5e-3), Shot(1.0e-3))
Pulses = Sequence[tuple[float, float]]
Source = Callable[[Pulses], list[TimedFrame]]
EVERY = {
    "level": (Told.LEVEL, on_change),
    "block": (Told.LEVELS_IN_BLOCK, lambda pulses: blocks(pulses, 0.0, 0.3)),
    "by stamp": (Told.TIME_BY_STAMP, durations),
}


@pytest.fixture(params=EVERY)
def kind(request: pytest.FixtureRequest) -> tuple[str, Source]:
    lines, source = EVERY[request.param]
    return lines, source


def test_pilot_and_main_have_a_command_each(tmp_path: Path, kind: tuple[str, Source]) -> None:
    lines, source = kind
    schedule, recording = injected(2, PILOT_AND_MAIN)
    watched = watch(pulse_bench(tmp_path, lines), samples(recording), source(commands(schedule)))
    assert [report.event for report in watched.reports] == [1, 1, 2, 2]
    assert watched.commands == [1, 2, 3, 4]
    assert watched.notes.mismatches == []


def test_a_misfire_is_missing(tmp_path: Path, kind: tuple[str, Source]) -> None:
    lines, source = kind
    schedule, recording = injected(3)
    pulses = commands(schedule)
    second = pulses[1][0]
    watched = watch(
        pulse_bench(tmp_path, lines), samples(misfired(recording, (second, second + 5e-3))), source(pulses)
    )
    assert watched.commands == [1, 3]
    assert (watched.missing, watched.uncommanded) == ([2], [])
    assert watched.notes.mismatches[0].index == pytest.approx(second * SAMPLE_RATE, abs=1)
    assert watched.notes.mismatches[0].as_text().startswith("injection missing: ")
    assert "3 ms of command 2 at index" in watched.notes.mismatches[0].as_text()
    assert watched.core.counters.missing_injections == 1


def test_a_pilot_that_misfires_leaves_the_main_its_command(tmp_path: Path, kind: tuple[str, Source]) -> None:
    lines, source = kind
    schedule, recording = injected(2, PILOT_AND_MAIN)
    pulses = commands(schedule)
    shut = misfired(recording, (pulses[0][0], pulses[1][0]))
    watched = watch(pulse_bench(tmp_path, lines), samples(shut), source(pulses))
    assert watched.commands == [2, 3, 4]
    assert (watched.missing, watched.uncommanded) == ([1], [])


def test_an_opening_nobody_asked_for(tmp_path: Path, kind: tuple[str, Source]) -> None:
    lines, source = kind
    schedule, recording = injected(3)
    first, _, third = commands(schedule)
    watched = watch(pulse_bench(tmp_path, lines), samples(recording), source([first, third]))
    assert watched.commands == [1, None, 2]
    assert (watched.missing, watched.uncommanded) == ([], [2])
    assert "injection 2 opened at index" in watched.notes.mismatches[0].as_text()
    assert watched.core.counters.uncommanded_injections == 1


def test_a_needle_that_bounces_has_no_second_command(tmp_path: Path) -> None:
    """Nor does its second opening take that of a pilot which misfired."""
    schedule, recording = injected(2, PILOT_AND_MAIN)
    pulses = commands(schedule)
    bounce = pulses[3][0] + 0.9e-3
    shut = misfired(recording, (pulses[2][0], pulses[3][0]), (bounce, bounce + 0.2e-3))
    watched = watch(pulse_bench(tmp_path, Told.LEVEL), samples(shut), on_change(pulses))
    assert watched.commands == [1, 2, 4, None]
    assert (watched.missing, watched.uncommanded) == ([3], [4])


def test_window_of_the_bench_file(tmp_path: Path) -> None:
    """An opening after it is not the command's."""
    schedule, recording = injected(2)
    lines = Told.LEVEL + "missing_after_ms = 0.2\n"
    watched = watch(pulse_bench(tmp_path, lines), samples(recording), on_change(commands(schedule)))
    assert watched.commands == [None, None]
    assert (watched.missing, watched.uncommanded) == ([1, 2], [1, 2])
    assert "within 0.2 ms" in next(one for one in watched.notes.mismatches if one.is_missing).as_text()


def test_nothing_is_missing_before_the_first_command(tmp_path: Path, kind: tuple[str, Source]) -> None:
    lines, source = kind
    schedule, recording = injected(3)
    third = commands(schedule)[2:]
    watched = watch(pulse_bench(tmp_path, lines), samples(recording), source(third))
    assert watched.commands == [None, None, 1]
    assert watched.notes.mismatches == []


@pytest.mark.parametrize("level", [0, 3])
def test_a_source_that_says_nothing(tmp_path: Path, level: int) -> None:
    """Level 0, or not available."""
    _, recording = injected(3)
    silent = [level_frame("PulseLevel", level, time, index_at(time)) for time in (0.1, 0.151, 0.2, 0.25)]
    watched = watch(pulse_bench(tmp_path, Told.LEVEL), samples(recording), silent)
    assert watched.commands == [None, None, None]
    assert watched.notes.mismatches == []


def test_a_needle_stuck_open_misses_nothing(tmp_path: Path, kind: tuple[str, Source]) -> None:
    lines, source = kind
    schedule, recording = injected(3)
    pulses = commands(schedule)
    lift = recording.needle_lift.copy()
    top = round((pulses[0][0] + 1.2e-3) * SAMPLE_RATE)
    lift[top:] = lift[top]
    watched = watch(
        pulse_bench(tmp_path, lines), samples(replace(recording, needle_lift=lift)), source(pulses)
    )
    assert watched.commands == [1]
    assert watched.notes.mismatches == []


@pytest.mark.parametrize("lost", [(-0.5e-3, 3e-3), (0.2e-3, 0.6e-3), (0.6e-3, 0.8e-3)])
def test_lost_samples_are_no_misfire(
    tmp_path: Path, kind: tuple[str, Source], lost: tuple[float, float]
) -> None:
    """The whole injection, its opening, or a part of it."""
    lines, source = kind
    schedule, recording = injected(3)
    pulses = commands(schedule)
    begin, end = (pulses[1][0] + edge for edge in lost)
    kept = [sent for sent in samples(recording) if not begin <= sent.time < end]
    watched = watch(pulse_bench(tmp_path, lines), kept, source(pulses))
    assert watched.notes.mismatches == []
    assert watched.commands[0] == 1
    assert watched.commands[-1] == 3
    if lost[0] < 0.32e-3 < lost[1] and len(watched.reports) == 3:
        assert watched.reports[1].commanded is not None  # its command is known, its opening was not seen
        assert np.isnan(watched.reports[1].commanded.opening_delay)


def test_a_lost_command_costs_one_alarm(tmp_path: Path) -> None:
    schedule, recording = injected(4)
    sent = safe_durations(commands(schedule))
    watched = watch(pulse_bench(tmp_path, Told.SAFE), samples(recording), [*sent[:1], *sent[2:]])
    assert watched.commands == [1, None, 2, 3]
    assert (watched.missing, watched.uncommanded) == ([], [2])


def test_a_pulse_generator_that_restarts_costs_nothing(tmp_path: Path) -> None:
    """Its counter begins anew."""
    schedule, recording = injected(4)
    pulses = commands(schedule)
    sent = [*safe_durations(pulses[:2]), *safe_durations(pulses[2:])]
    watched = watch(pulse_bench(tmp_path, Told.SAFE), samples(recording), sent)
    assert watched.commands == [1, 2, 3, 4]
    assert watched.notes.mismatches == []


@pytest.mark.parametrize("frame", [2, 3])
def test_a_lost_level_costs_one_alarm_at_most(tmp_path: Path, frame: int) -> None:
    """The start or the end of the second energizing."""
    schedule, recording = injected(4)
    sent = on_change(commands(schedule))
    watched = watch(
        pulse_bench(tmp_path, Told.LEVEL), samples(recording), [*sent[:frame], *sent[frame + 1 :]]
    )
    assert watched.missing == []
    assert len(watched.uncommanded) <= 1
    assert watched.commands[0] is not None
    assert watched.commands[3] is not None


@pytest.mark.parametrize("edge", [0.0, 1.1e-3])
def test_lost_blocks_of_levels_cost_none(tmp_path: Path, edge: float) -> None:
    """With the start or the end of the second energizing in them."""
    schedule, recording = injected(4)
    pulses = commands(schedule)
    at = pulses[1][0] + edge
    sent = [one for one in blocks(pulses, 0.0, 0.35) if not at <= one.time < at + 0.8e-3]
    watched = watch(pulse_bench(tmp_path, Told.LEVELS_IN_BLOCK), samples(recording), sent)
    assert watched.notes.mismatches == []
    assert None not in (watched.commands[0], watched.commands[2], watched.commands[3])


def test_a_cyclic_source_that_falls_silent_is_not_believed(tmp_path: Path) -> None:
    schedule, recording = injected(4)
    pulses = commands(schedule)
    sent = [one for one in cyclic(pulses, 0.35) if one.time < 0.19]
    watched = watch(pulse_bench(tmp_path, Told.CYCLIC), samples(recording), sent)
    assert watched.commands == [1, None, None, None]
    assert watched.notes.mismatches == []


def test_repeated_and_overtaken_frames_are_no_command(tmp_path: Path) -> None:
    """A duration with an index may be sent cyclically, until the next."""
    schedule, recording = injected(3)
    pulses = commands(schedule)
    sent = []
    for start, duration in pulses:
        sent += [duration_frame(duration, start + n * 5e-3, index_at(start)) for n in range(9)]
    late = duration_frame(1.1e-3, pulses[1][0] + 1e-3, index_at(pulses[1][0] - 5e-3))
    watched = watch(pulse_bench(tmp_path, Told.TIME), samples(recording), sent, [late])
    assert watched.commands == [1, 2, 3]
    assert watched.notes.mismatches == []


@pytest.mark.parametrize("lead", [-0.5e-3, 0.5e-3, 20e-3])
def test_commands_may_come_before_or_after_their_samples(tmp_path: Path, lead: float) -> None:
    """Where an index places them."""
    schedule, recording = injected(3)
    sent = later(durations(commands(schedule)), lead)
    watched = watch(pulse_bench(tmp_path, Told.TIME), samples(recording), sent)
    assert watched.commands == [1, 2, 3]
    assert watched.notes.mismatches == []


def test_a_command_after_its_report_is_not_missing_too(tmp_path: Path) -> None:
    schedule, recording = injected(4)
    sent = durations(commands(schedule))
    sent[1:2] = later(sent[1:2], 45e-3)
    watched = watch(pulse_bench(tmp_path, Told.TIME), samples(recording), sent)
    assert (watched.missing, watched.uncommanded) == ([], [2])
    assert watched.commands[2:] == [3, 4]


def test_stamps_change_nothing_where_an_index_is_carried(tmp_path: Path, kind: tuple[str, Source]) -> None:
    lines, source = kind
    schedule, recording = injected(2)
    random = np.random.default_rng(1)
    frames = merged(samples(recording), source(commands(schedule)))
    bench = pulse_bench(tmp_path, lines)
    prompt = watch(bench, frames)
    late = run(bench, [one._replace(time=random.random()) for one in frames], learning=False)
    assert late.frames == prompt.frames
    if "index" in lines or "pattern" in lines:
        assert [report.commanded for report in late.reports] == [
            report.commanded for report in prompt.reports
        ]
        assert late.notes.mismatches == prompt.notes.mismatches == []


def test_it_changes_no_result(tmp_path: Path, kind: tuple[str, Source]) -> None:
    lines, source = kind
    schedule, recording = injected(2)
    bench = pulse_bench(tmp_path, lines)
    with_it = watch(bench, samples(recording), source(commands(schedule)))
    without = watch(bench, samples(recording))
    assert with_it.frames == without.frames
    assert without.core.energizing is not None
    assert without.core.energizing.commands == 0


def test_of_more_commands_than_wait_for_python_the_oldest_are_lost(tmp_path: Path) -> None:
    loaded = load_bench(pulse_bench(tmp_path, Told.SAFE))
    core = Core(loaded.injector, map_bus(loaded))
    commands = safe_durations((1e-3 * n, 0.5e-3) for n in range(READINGS + 5))
    block, number = (
        block_of([BusFrame(one.bus, Frame(one.frame_id, one.payload, one.stamp_ns)) for one in commands]),
        0,
    )
    while number < block.frames:
        number, _ = core.compiled.take_many(block, number)
    core.attend()
    assert core.energizing is not None
    assert core.energizing.commands == READINGS


def test_a_damaged_or_repeated_frame_is_no_command(tmp_path: Path) -> None:
    """The damaged one is a lost one."""
    schedule, recording = injected(4)
    first, second, third, fourth = safe_durations(commands(schedule))
    told = [
        first,
        *later([first], 10e-3),
        damaged(second, 30),
        third,
        fourth,
    ]
    watched = watch(pulse_bench(tmp_path, Told.SAFE), samples(recording), told)
    assert watched.commands == [1, None, 2, 3]
    assert (watched.missing, watched.uncommanded) == ([], [2])
    assert watched.core.counters.crc_errors == 1
