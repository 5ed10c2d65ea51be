"""Commands from levels: every rising edge, whatever the blocks, and nothing invented where blocks are lost."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.bus.mapping.optional_inputs import EnergizingLayout, EnergizingSignal
from observer_rt.config.bench import load_bench
from observer_rt.engine.service.energizing import Command, CommandReader
from tests.benches import SAMPLE_RATE
from tests.daemon.pulses import LEVELS, EnergizingBy, pulse_bench

INDICES = 1 << 32
FIRST = st.sampled_from([0, 12345, INDICES - 70])  # of the samples: the count may begin again among them
STRETCHES = st.lists(st.integers(1, 45), min_size=1, max_size=10)


@pytest.fixture(scope="module")
def in_blocks(tmp_path_factory: pytest.TempPathFactory) -> EnergizingLayout:
    return energizing(tmp_path_factory.mktemp("blocks"), EnergizingBy.LEVELS_IN_BLOCK)


def energizing(folder: Path, lines: str) -> EnergizingLayout:
    mapped = map_bus(load_bench(pulse_bench(folder, lines))).energizing
    assert mapped is not None
    return mapped


@dataclass(frozen=True)
class Pulses:
    """Levels of consecutive samples, low first, and where they rise and fall."""

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


def read(
    mapped: EnergizingLayout, commands: Pulses, first: int, lost: set[int]
) -> tuple[CommandReader, list[Command]]:
    reader = CommandReader(mapped, SAMPLE_RATE)
    results: list[Command] = []
    for number in range(len(commands.levels) // LEVELS):
        if number not in lost:
            values = np.array(commands.levels[number * LEVELS : (number + 1) * LEVELS], float)
            results += reader.read(EnergizingSignal((first + number * LEVELS) % INDICES, 0, values, None))
    return reader, results


@given(STRETCHES, FIRST)
def test_every_rising_edge_is_a_command(
    in_blocks: EnergizingLayout, stretches: list[int], first: int
) -> None:
    commands = pulses(stretches)
    _, result = read(in_blocks, commands, first, set())
    assert [(one.start - first) % INDICES for one in result] == commands.starts
    assert [round(one.duration * SAMPLE_RATE) for one in result] == commands.lengths
    assert all(one.margin == 0.0 for one in result)


@given(STRETCHES, FIRST, st.sets(st.integers(0, 10)))
def test_what_is_lost_is_known_to_be(
    in_blocks: EnergizingLayout, stretches: list[int], first: int, lost: set[int]
) -> None:
    """Commands are true ones; a true one that is not found lies in a span said to be lost."""
    commands = pulses(stretches)
    reader, result = read(in_blocks, commands, first, lost)
    certain = [(command.start - first) % INDICES for command in result]
    assert set(certain) <= set(commands.starts)
    for command in result:
        length = dict(zip(commands.starts, commands.lengths, strict=True)).get(
            (command.start - first) % INDICES
        )
        assert np.isnan(command.duration) or round(command.duration * SAMPLE_RATE) == length
    spans = [((begin - first) % INDICES, (end - first) % INDICES) for begin, end in reader.lost]
    end_of_last = (
        max((n + 1 for n in range(len(commands.levels) // LEVELS) if n not in lost), default=0) * LEVELS
    )
    for start in set(commands.starts) - set(certain):
        is_told = any(begin <= start <= end or (begin > end and start <= end) for begin, end in spans)
        assert is_told or start >= end_of_last


def test_a_cyclic_level_changed_in_the_middle_between_two_frames(tmp_path: Path) -> None:
    reader = CommandReader(energizing(tmp_path, EnergizingBy.CYCLIC), SAMPLE_RATE)
    results = []
    for millisecond, level in enumerate((0, 0, 1, 1, 0)):
        results += reader.read(EnergizingSignal(None, millisecond * 10**6, np.array([level], float), None))
    [command] = results
    assert command.start == 1_500_000
    assert command.margin == 0.5e-3 * SAMPLE_RATE
    assert command.duration == pytest.approx(2e-3)


@pytest.mark.parametrize("nothing", [0.0, -1e-3, np.nan, np.inf])
def test_no_duration_is_no_command(tmp_path: Path, nothing: float) -> None:
    reader = CommandReader(energizing(tmp_path, EnergizingBy.TIME), SAMPLE_RATE)
    assert reader.read(EnergizingSignal(100, 0, np.array([nothing]), None)) == []
