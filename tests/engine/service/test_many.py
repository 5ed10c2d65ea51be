"""Many frames in one call give what the same frames give one by one: frames, reports, counters."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from observer_rt.bus.links.link import BusFrame, Frame, block_of
from observer_rt.engine.service.core import Core
from observer_rt.engine.service.messages import OutputFrame
from observer_rt.files.replay.framing import TimedFrame
from tests import device
from tests.benches import ONE_MESSAGE, THREE_MESSAGES, sample_bench
from tests.daemon.pulses import PILOT_AND_MAIN, SOURCES, injected, misfired, pulse_bench, samples
from tests.device import Device, Result, damaged, inserted, merged, run, simulated


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
    """All that a core made of frames."""
    fuel = [report.fuel_temperature for report in result.reports]
    events = result.core.knowledge.state.events
    return result.frames, result.core.counters, events, fuel, result.commands, result.notes.mismatches


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
    """A command without an injection, and an injection without a command."""
    lines, source = SOURCES[name]
    pulses, made = injected(3, PILOT_AND_MAIN)
    made = misfired(made, (pulses[2][0], pulses[2][0] + 1.2e-3))
    frames = merged(samples(made), source(pulses[:-1]))
    assert either_way(pulse_bench(tmp_path, lines), frames, learning=False).notes.mismatches
