"""Many frames in one call give what the same frames give one by one: frames, reports, counters."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from observer_rt.bus.links.link import BusFrame, Frame, block_of
from observer_rt.recording.replay.framing import TimedFrame
from observer_rt.service.core.core import Core
from observer_rt.service.core.messages import OutputFrame
from observer_rt.simulation.schedule import Shot
from tests import device
from tests.benches import ONE_MESSAGE, THREE_MESSAGES, sample_bench, twin_bench
from tests.device import Device, damaged, frames_of, inserted, run, shuffled, simulated, worn_recording
from tests.service.inputs import test_energizing, test_fuel_temperature
from tests.service.pulse_bench import pulse_bench
from tests.service.pulse_frames import commands, injected, misfired, samples, watch
from tests.service.slow_frames import bed, slow_bench

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


@pytest.fixture
def many(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """From the call on, cores take many frames at once."""

    def change() -> None:
        monkeypatch.setattr(device, "Core", ManyAtOnce)

    return change


def _disturbed(bench: Path) -> list[TimedFrame]:
    """With a damaged frame, a lost one and some that are none of ours."""
    frames = Device(bench).send(simulated())
    frames[300] = damaged(frames[300], 77)
    del frames[700]
    return inserted(frames, [(n, TimedFrame(0.0, 0x7, False, False, b"\x00")) for n in range(0, 900, 90)])


@pytest.mark.parametrize("messages", [ONE_MESSAGE, THREE_MESSAGES])
def test_while_it_learns(tmp_path: Path, many: Callable[[], None], messages: dict[str, str]) -> None:
    path = sample_bench(tmp_path, messages)
    frames = _disturbed(path)
    expected = run(path, frames)
    many()
    found = run(path, frames)
    assert found.frames == expected.frames
    assert found.core.counters == expected.core.counters
    assert found.core.knowledge.events == expected.core.knowledge.events == 3


def test_from_several_buses(tmp_path: Path, many: Callable[[], None]) -> None:
    path = twin_bench(tmp_path)
    frames = shuffled(frames_of(path, worn_recording()), 0.01, 1)
    expected = run(path, frames)
    many()
    found = run(path, frames)
    assert found.frames == expected.frames
    assert found.core.counters == expected.core.counters


def _fuel(bench: Path, celsius: Sequence[float | None]) -> list[TimedFrame]:
    """A temperature every 200 frames: within events, between them, and stale in the end."""
    frames = Device(bench).send(test_fuel_temperature.simulation(40.0).recording)
    told = ((200 * n, test_fuel_temperature.sensor(each)) for n, each in enumerate(celsius))
    return inserted(frames, told)


def test_with_fuel_that_warms_up_and_is_lost(tmp_path: Path, many: Callable[[], None]) -> None:
    path = test_fuel_temperature.bench(tmp_path, "timeout_ms = 50\n")
    frames = _fuel(path, [40.0, 40.0, 52.0, 52.1, 60.0, None, 41.0, 40.0])
    expected = run(path, frames)
    many()
    found = run(path, frames)
    assert found.frames == expected.frames
    temperatures = [report.fuel_temperature for report in expected.reports]
    assert [report.fuel_temperature for report in found.reports] == temperatures
    assert len(set(temperatures)) > 1


def test_with_learning_held_up_for_a_while(tmp_path: Path, many: Callable[[], None]) -> None:
    path = slow_bench(tmp_path, {"learning_enable": ("Bed", "LearnEnable"), "measured_mass": ("Bed", "Mass")})
    made = simulated(4)
    values = [(n, bed("LearnEnable", int(n // 400 % 2))) for n in range(0, made.samples // BLOCK, 50)]
    frames = inserted(Device(path).send(made), [*values, (1500, bed("Mass", 12.0))])
    expected = run(path, frames)
    many()
    found = run(path, frames)
    assert found.frames == expected.frames
    assert 0 < found.core.knowledge.events == expected.core.knowledge.events < 4


@pytest.mark.parametrize("name", test_energizing.SOURCES)
def test_with_commands(tmp_path: Path, many: Callable[[], None], name: str) -> None:
    """One of which has no injection, and one injection no command."""
    lines, source, *_ = test_energizing.SOURCES[name]
    schedule, made = injected(3, (Shot(0.3e-3, -1.5e-3), Shot(1.0e-3)))
    told = commands(schedule)
    made = misfired(made, (told[2][0], told[2][0] + 1.2e-3))
    sent = samples(made), source(told[:-1])
    path = pulse_bench(tmp_path, lines)
    expected = watch(path, *sent)
    many()
    found = watch(path, *sent)
    assert found.frames == expected.frames
    assert found.notes.mismatches == expected.notes.mismatches != []
    assert found.commands == expected.commands
    assert found.core.counters == expected.core.counters
