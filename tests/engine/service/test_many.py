"""Frames of any bytes do no harm (see `tools/test --debug-core`), and many in one call give what single ones give."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.bus.links.link import BusFrame, Frame, block_of
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import EXAMPLE_BENCH, load_bench
from observer_rt.engine.service.core import Core
from observer_rt.engine.service.messages import OutputFrame
from observer_rt.files.replay.framing import TimedFrame
from tests import device
from tests.benches import ONE_MESSAGE, THREE_MESSAGES, sample_bench
from tests.daemon.pulses import PILOT_AND_MAIN, SOURCES, injected, misfired, pulse_bench, samples
from tests.device import Device, Result, core_of, damaged, frames_of, hand, inserted, merged, run, simulated

CLASSIC = Path(__file__).parents[2] / "bus" / "databases" / "testbed_classic.toml"


FRAMES = st.lists(st.tuples(st.integers(0, 3), st.binary(max_size=64), st.integers(-(10**9), 10**9)), max_size=400)


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
        1 for number, payload, _ in frames if number < len(lengths) and len(payload) < [*lengths.values()][number]
    )
    assert counters.length_errors >= wrong


@given(st.binary(min_size=64, max_size=64))
def test_content_of_unwritten_memory_changes_nothing(rubbish: bytes) -> None:
    """Fresh memory of a ring may hold any bytes."""
    frames = frames_of(EXAMPLE_BENCH, simulated(1))[:600]
    clean, dirty = core_of(EXAMPLE_BENCH), core_of(EXAMPLE_BENCH)
    observer = dirty.compiled.observer
    for ring in (observer.recorded, observer.ring, observer.x_tilde, observer.x_hat):
        raw = ring.view(np.uint8).reshape(-1)
        raw[:] = np.resize(np.frombuffer(rubbish, np.uint8), raw.size)
    assert hand(dirty, frames) == hand(clean, frames)


class ManyAtOnce(Core):
    """Takes its frames at the end, in parts of many sizes."""

    def __init__(self, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self._gathered: list[BusFrame] = []

    def handle(
        self, frame_id: int, is_extended: bool, payload: bytes, stamp_ns: int, bus: int = 0
    ) -> list[OutputFrame]:
        self._gathered.append(BusFrame(bus, Frame(frame_id, payload, stamp_ns, is_extended)))
        return []

    def finish(self) -> list[OutputFrame]:
        random, frames, first = np.random.default_rng(5), [], 0
        while first < len(self._gathered):
            end = first + int(random.choice([1, 2, 30, 400, 2000]))
            frames += self.handle_many(block_of(self._gathered[first:end]))
            first = end
        return frames + super().finish()


def facts(result: Result) -> tuple[object, ...]:
    fuel = [report.surroundings for report in result.reports]
    events = result.core.knowledge.state.events
    return result.frames, result.core.counters, events, fuel, result.commands, result.notes.missing


@pytest.fixture
def either_way(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Result]:
    """What comes of frames one by one, once many at once have given the same."""

    def compared(path: Path, frames: Iterable[TimedFrame], **options: Any) -> Result:
        sent = list(frames)
        expected = run(path, sent, **options)
        monkeypatch.setattr(device, "Core", ManyAtOnce)
        assert facts(run(path, sent, **options)) == facts(expected)
        return expected

    return compared


@pytest.mark.parametrize("messages", [ONE_MESSAGE, THREE_MESSAGES])
def test_while_it_learns(tmp_path: Path, either_way: Callable[..., Result], messages: dict[str, str]) -> None:
    """With a damaged frame, a lost one and some of other devices."""
    path = sample_bench(tmp_path, messages)
    frames = Device(path).send(simulated())
    frames[300] = damaged(frames[300], 77)
    del frames[700]
    foreign = [(n, TimedFrame(0.0, 0x7, False, False, b"\x00")) for n in range(0, 900, 90)]
    assert either_way(path, inserted(frames, foreign)).core.knowledge.state.events == 3


@pytest.mark.parametrize("name", SOURCES)
def test_with_commands(tmp_path: Path, either_way: Callable[..., Result], name: str) -> None:
    """A command without an injection, and an injection whose command did not come."""
    lines, source = SOURCES[name]
    pulses, made = injected(3, PILOT_AND_MAIN)
    made = misfired(made, (pulses[3][0], pulses[3][0] + 5e-3))
    frames = merged(samples(made), source(pulses[:-1]))
    assert either_way(pulse_bench(tmp_path, lines), frames, learning=False).notes.missing
