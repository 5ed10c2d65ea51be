"""Frames of any bytes and memory of any content: no access is out of bounds, and nothing unwritten is read.

In `tools/test --debug-core` every access beyond an array ends the process.
"""

from pathlib import Path

import cantools
import numpy as np
import pytest
from cantools.database.can import Database
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import EXAMPLE_BENCH, load_bench
from observer_rt.engine.service.core import Core
from tests.device import core_of, frames_of, hand, simulated

CLASSIC = Path(__file__).parents[2] / "bus" / "databases" / "testbed_classic.toml"


def database() -> Database:
    result = cantools.database.load_file(CLASSIC.with_suffix(".dbc"))
    assert isinstance(result, Database)
    return result


FRAMES = st.lists(
    st.tuples(st.integers(0, 3), st.binary(max_size=64), st.integers(-(10**9), 10**9)), max_size=400
)


@pytest.mark.parametrize("bench", [EXAMPLE_BENCH, CLASSIC], ids=["protected", "three messages"])
@given(frames=FRAMES)
def test_any_bytes_are_counted_and_harm_nothing(bench: Path, frames: list[tuple[int, bytes, int]]) -> None:
    loaded = load_bench(bench)
    bus = map_bus(loaded)
    core = Core(loaded.injector, bus, learning=False)
    lengths = {layout.frame_id: layout.length for layout in bus.input_layouts}
    of_ours = dict.fromkeys(lengths, 0)
    for number, payload, stamp in frames:
        frame_id = [*lengths, 0x7FF][min(number, len(lengths))]
        core.handle(frame_id, False, payload, stamp)
        if frame_id in lengths:
            of_ours[frame_id] += 1
    core.finish()
    counters = core.counters
    assert counters.frames == sum(of_ours.values())
    wrong = sum(
        1
        for number, payload, _ in frames
        if number < len(lengths) and len(payload) < [*lengths.values()][number]
    )
    assert counters.length_errors >= wrong


@given(st.binary(min_size=64, max_size=64))
def test_content_of_unwritten_memory_changes_nothing(rubbish: bytes) -> None:
    """Fresh memory of a ring may hold any bytes."""
    recording = simulated(1)
    frames = frames_of(EXAMPLE_BENCH, recording)[:600]
    clean, dirty = core_of(EXAMPLE_BENCH), core_of(EXAMPLE_BENCH)
    observer = dirty.compiled.observer
    for ring in (observer.recorded, observer.ring, observer.x_tilde, observer.x_hat):
        raw = ring.view(np.uint8).reshape(-1)
        raw[:] = np.resize(np.frombuffer(rubbish, np.uint8), raw.size)
    assert hand(dirty, frames) == hand(clean, frames)
