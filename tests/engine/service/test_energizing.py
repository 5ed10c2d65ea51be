"""The optional input `energizing`: commands from levels and durations, and which opening belongs to which."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.bus.mapping.optional_inputs import EnergizingLayout, EnergizingSignal
from observer_rt.config.bench import load_bench, load_injector
from observer_rt.engine.service.commands import Command, CommandReader
from tests.benches import SAMPLE_RATE
from tests.daemon.pulses import (
    BED,
    LEVELS,
    PILOT_AND_MAIN,
    SOURCES,
    EnergizingBy,
    durations,
    index_at,
    injected,
    pulse_bench,
    samples,
    watch,
)
from tests.device import encoded, later, merged, run

DELAY = load_injector().needle.opening_delay
SAMPLE = 1 / SAMPLE_RATE
ERRORS = {  # of delay and duration [s]
    "level": (SAMPLE, SAMPLE),
    "duration": (SAMPLE, 1e-7),
    "block": (SAMPLE, SAMPLE),
    "by stamp": (SAMPLE, 1e-7),
    "protected": (SAMPLE, 1e-7),
    "cyclic": (1e-3 + SAMPLE, 1e-3),
}

INDICES = 1 << 32
FIRST = st.sampled_from([0, 12345, INDICES - 70])  # of the samples: the count may begin again among them
STRETCHES = st.lists(st.integers(1, 45), min_size=1, max_size=10)


@pytest.mark.parametrize("name", SOURCES)
def test_every_opening_has_its_command(tmp_path: Path, name: str) -> None:
    (lines, source), (delay_error, time_error) = SOURCES[name], ERRORS[name]
    pulses, recording = injected(3)
    watched = watch(pulse_bench(tmp_path, lines), recording, source(pulses))
    assert watched.energized == ([1, 2, 3], [])
    for report in watched.reports:
        assert report.commanded is not None
        assert report.commanded.opening_delay == pytest.approx(DELAY, abs=1.5 * delay_error)
        assert report.commanded.energizing_time == pytest.approx(1.1e-3, abs=1.01 * time_error)


@pytest.mark.parametrize(
    ("late", "stated", "made_up"),
    [(0.3e-3, "", 0.0), (0.8e-3, "", 0.0), (2e-3, "delay_us = 2000\n", 2e-3)],
    ids=["before it opens", "after it opened", "stated"],
)
def test_a_late_stamp_makes_the_delay_too_short(tmp_path: Path, late: float, stated: str, made_up: float) -> None:
    """Even below zero it is the same command, that of a pilot, too. Stated delays are made up for."""
    pulses, recording = injected(2, PILOT_AND_MAIN)
    bench = pulse_bench(tmp_path, EnergizingBy.TIME_BY_STAMP + stated)
    watched = watch(bench, recording, later(durations(pulses), late))
    assert watched.energized == ([1, 2, 3, 4], [])
    for report in watched.reports:
        assert report.commanded is not None
        assert report.commanded.opening_delay == pytest.approx(DELAY - late + made_up, abs=1.5 * SAMPLE)


@pytest.mark.parametrize("step", [5e-3, -5e-3, 1.0])
def test_no_alarm_while_the_receivers_clock_was_set(tmp_path: Path, step: float) -> None:
    """At first commands are not known, later they are again."""
    pulses, recording = injected(28)
    frames = merged(samples(recording), durations(pulses))
    stamped = [one._replace(time=one.time + step) if one.time > 0.96 else one for one in frames]
    watched = run(pulse_bench(tmp_path, EnergizingBy.TIME_BY_STAMP), stamped, learning=False)
    assert watched.notes.missing == []
    assert (watched.commands[:16], watched.commands[-2:]) == ([*range(1, 17)], [27, 28])
    assert None in watched.commands


def test_multiplexed_message(tmp_path: Path) -> None:
    """Pages without the duration say nothing."""
    pulses, recording = injected(2)
    message = BED.get_message_by_name("Pages")
    sent = []
    for start, duration in pulses:
        page = {"Page": 2, "PageDuration": duration / 1e-6, "PageIndex": index_at(start)}
        sent.append(encoded(message, page, start))
        sent.append(encoded(message, {"Page": 1, "PageOther": 500}, start + 1e-3))
    lines = 'message = "Pages"\nsignal = "PageDuration"\nindex = "PageIndex"\n'
    assert watch(pulse_bench(tmp_path, lines), recording, sent).energized == ([1, 2], [])


def test_mean_and_spread_of_the_delays(tmp_path: Path) -> None:
    """Commands arrive 40 us too late and too early in turn."""
    pulses, recording = injected(4)
    moved = [(start + 40e-6 * (-1) ** n, duration) for n, (start, duration) in enumerate(pulses)]
    figures = watch(pulse_bench(tmp_path, EnergizingBy.TIME), recording, durations(moved)).core.optional.energizing
    assert figures is not None
    assert figures.commands == 4
    assert figures.mean_delay == pytest.approx(DELAY, abs=1.5 * SAMPLE)
    assert figures.delay_sigma == pytest.approx(40e-6, abs=10e-6)
    assert "4 commands, 0 injections missing" in figures.as_text()


@pytest.fixture(scope="module")
def in_blocks(tmp_path_factory: pytest.TempPathFactory) -> EnergizingLayout:
    return energizing(tmp_path_factory.mktemp("blocks"), EnergizingBy.LEVELS_IN_BLOCK)


def energizing(folder: Path, lines: str) -> EnergizingLayout:
    mapped = map_bus(load_bench(pulse_bench(folder, lines))).energizing
    assert mapped is not None
    return mapped


@dataclass(frozen=True)
class Pulses:
    levels: list[int]
    starts: list[int]
    lengths: list[int]


def pulses(stretches: list[int]) -> Pulses:
    """Low and high in turn, so many samples each; whole blocks, low at the end."""
    edges = np.cumsum(stretches).tolist()
    starts, ends = edges[:-1:2], edges[1::2]
    size = -(-(edges[-1] + 1) // LEVELS) * LEVELS
    levels = np.zeros(size, np.int64)
    for start, end in zip(starts, ends, strict=False):
        levels[start:end] = 1
    return Pulses(levels.tolist(), starts, [end - start for start, end in zip(starts, ends, strict=False)])


def read(mapped: EnergizingLayout, commands: Pulses, first: int, lost: set[int]) -> list[Command]:
    reader = CommandReader(mapped, SAMPLE_RATE)
    results: list[Command] = []
    for number in range(len(commands.levels) // LEVELS):
        if number not in lost:
            values = np.array(commands.levels[number * LEVELS : (number + 1) * LEVELS], float)
            results += reader.read(EnergizingSignal((first + number * LEVELS) % INDICES, 0, values, None))
    return results


@given(STRETCHES, FIRST)
def test_every_rising_edge_is_a_command(in_blocks: EnergizingLayout, stretches: list[int], first: int) -> None:
    commands = pulses(stretches)
    result = read(in_blocks, commands, first, set())
    assert [(one.start - first) % INDICES for one in result] == commands.starts
    assert [round(one.duration * SAMPLE_RATE) for one in result] == commands.lengths


@given(STRETCHES, FIRST, st.sets(st.integers(0, 10)))
def test_what_is_found_beside_losses_is_true(
    in_blocks: EnergizingLayout, stretches: list[int], first: int, lost: set[int]
) -> None:
    commands = pulses(stretches)
    result = read(in_blocks, commands, first, lost)
    starts = dict(zip(commands.starts, commands.lengths, strict=True))
    for command in result:
        length = starts[(command.start - first) % INDICES]
        assert np.isnan(command.duration) or round(command.duration * SAMPLE_RATE) == length


@pytest.mark.parametrize("nothing", [0.0, -1e-3, np.nan, np.inf])
def test_no_duration_is_no_command(tmp_path: Path, nothing: float) -> None:
    reader = CommandReader(energizing(tmp_path, EnergizingBy.TIME), SAMPLE_RATE)
    assert reader.read(EnergizingSignal(100, 0, np.array([nothing]), None)) == []
