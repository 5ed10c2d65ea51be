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
from tests.benches import ONE_MESSAGE, THREE_MESSAGES, sample_bench, twin_bench
from tests.daemon.pulses import PILOT_AND_MAIN, SOURCES, injected, misfired, pulse_bench, samples
from tests.daemon.slow_frames import bed, slow_bench
from tests.device import (
    Device,
    Result,
    damaged,
    frames_of,
    inserted,
    merged,
    run,
    shuffled,
    simulated,
    worn_recording,
)
from tests.engine.service import test_fuel_temperature

BLOCK = 9  # samples in a frame


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
    known = result.core.knowledge.state.events
    return result.frames, result.core.counters, known, fuel, result.commands, result.notes.mismatches


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
    """With a damaged frame, a lost one and some that are none of ours."""
    path = sample_bench(tmp_path, messages)
    frames = Device(path).send(simulated())
    frames[300] = damaged(frames[300], 77)
    del frames[700]
    foreign = [(n, TimedFrame(0.0, 0x7, False, False, b"\x00")) for n in range(0, 900, 90)]
    assert either_way(path, inserted(frames, foreign)).core.knowledge.state.events == 3


def test_from_several_buses(tmp_path: Path, either_way: Callable[..., Result]) -> None:
    path = twin_bench(tmp_path)
    assert either_way(path, shuffled(frames_of(path, worn_recording()), 0.01, 1)).frames


def test_with_fuel_that_warms_up_and_is_lost(tmp_path: Path, either_way: Callable[..., Result]) -> None:
    """A temperature every 200 frames: within events, between them, and stale in the end."""
    path = test_fuel_temperature.bench(tmp_path, "timeout_ms = 50\n")
    frames = Device(path).send(test_fuel_temperature.simulation(40.0).recording)
    celsius = (40.0, 40.0, 52.0, 52.1, 60.0, None, 41.0, 40.0)
    told = ((200 * n, test_fuel_temperature.sensor(each)) for n, each in enumerate(celsius))
    result = either_way(path, inserted(frames, told))
    assert len({report.fuel_temperature for report in result.reports}) > 1


def test_with_learning_held_up_for_a_while(tmp_path: Path, either_way: Callable[..., Result]) -> None:
    path = slow_bench(tmp_path, {"learning_enable": ("Bed", "LearnEnable"), "measured_mass": ("Bed", "Mass")})
    made = simulated(4)
    values = [(n, bed("LearnEnable", int(n // 400 % 2))) for n in range(0, made.samples // BLOCK, 50)]
    frames = inserted(Device(path).send(made), [*values, (1500, bed("Mass", 12.0))])
    assert 0 < either_way(path, frames).core.knowledge.state.events < 4


@pytest.mark.parametrize("name", SOURCES)
def test_with_commands(tmp_path: Path, either_way: Callable[..., Result], name: str) -> None:
    """One of which has no injection, and one injection no command."""
    lines, source = SOURCES[name]
    pulses, made = injected(3, PILOT_AND_MAIN)
    made = misfired(made, (pulses[2][0], pulses[2][0] + 1.2e-3))
    frames = merged(samples(made), source(pulses[:-1]))
    assert either_way(pulse_bench(tmp_path, lines), frames, learning=False).notes.mismatches
