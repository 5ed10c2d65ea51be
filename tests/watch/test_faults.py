"""What is wrong: which message, since when, what to do."""

from pathlib import Path

import pytest

from observer_rt.bus.links.link import BusFrame, Frame
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.bus.mapping.output_messages import StatusValues
from observer_rt.config.bench import load_bench
from observer_rt.observer.stream.state import Reason, State
from observer_rt.recording.replay.framing import Span
from observer_rt.service.core.messages import FrameWriter
from observer_rt.service.words import REASONS
from observer_rt.watch.injector import WatchedInjector
from tests.benches import THREE_MESSAGES, sample_bench
from tests.device import Device, simulated

SECOND = 1_000_000_000
BEGIN = 1_780_000_000 * SECOND


class Bus:
    """Devices and an observer at work, until some of them are switched off."""

    def __init__(self, folder: Path) -> None:
        bench = load_bench(sample_bench(folder, THREE_MESSAGES))
        self.bus = map_bus(bench)
        self.injector = WatchedInjector(bench)
        self.injector.begin(BEGIN)
        self.frames = {frame.frame_id: frame for frame in Device(bench).send(simulated(), Span(0, 56))}
        self._status = FrameWriter(self.bus.status)

    def run(
        self,
        start: float,
        end: float,
        without: str = "",
        state: State = State.ADAPTED,
        reason: Reason = Reason.NONE,
        with_status: bool = True,
    ) -> None:
        """Frames every 100 ms between times [s]."""
        silent = {layout.frame_id for layout in self.bus.input_layouts if layout.name == without}
        for tenth in range(round(10 * start), round(10 * end)):
            now = BEGIN + tenth * SECOND // 10
            for frame_id, frame in self.frames.items():
                if frame_id not in silent:
                    self.injector.take(BusFrame(0, Frame(frame_id, frame.payload, now)), now)
            if with_status:
                values = dict.fromkeys(StatusValues._fields, 0) | {"state": state, "reason": reason}
                for sent in self._status.write(StatusValues(**values)):  # type: ignore[arg-type]
                    self.injector.take(BusFrame(0, Frame(sent.frame_id, sent.payload, now)), now)

    def faults(self, at: float) -> list[tuple[str, float, str]]:
        """What is wrong at a time [s]: what, since when [s], what to do."""
        found = self.injector.seen(BEGIN + round(at * SECOND)).faults
        return [(fault.what, (fault.since - BEGIN) / SECOND, fault.remedy) for fault in found]


@pytest.fixture
def bus(tmp_path: Path) -> Bus:
    return Bus(tmp_path)


def test_all_is_well(bus: Bus) -> None:
    bus.run(0.0, 5.0)
    assert bus.faults(5.0) == []


def test_a_message_that_stays_away_is_named_with_its_signal(bus: Bus) -> None:
    bus.run(0.0, 3.0)
    bus.run(3.0, 6.0, without="NeedleLiftBlock")
    ((what, since, remedy),) = bus.faults(6.0)
    assert what.startswith("NeedleLiftBlock 0x111 (needle_lift): no frame")
    assert since == pytest.approx(2.9, abs=0.15)
    assert "cable" in remedy
    bus.run(6.0, 6.2)
    assert bus.faults(6.2) == []


def test_without_the_observer_one_is_told_to_start_it(bus: Bus) -> None:
    bus.run(0.0, 4.0, with_status=False)
    ((what, since, remedy),) = bus.faults(4.0)
    assert what.startswith("ObserverStatus")
    assert since == 0.0
    assert "observer-rt run" in remedy


def test_a_bad_state_is_told_once_it_lasts(bus: Bus) -> None:
    bus.run(0.0, 2.0)
    bus.run(2.0, 4.0, state=State.DEGRADED, reason=Reason.MODEL_INADEQUATE)
    assert bus.faults(2.5) == []
    bus.run(4.0, 4.1, state=State.DEGRADED, reason=Reason.MODEL_INADEQUATE)
    ((what, _, remedy),) = bus.faults(4.0)
    assert what == f"MODEL_INADEQUATE: {REASONS[Reason.MODEL_INADEQUATE].what}"
    assert remedy == REASONS[Reason.MODEL_INADEQUATE].remedy


def test_a_source_that_sends_windows_is_no_fault(bus: Bus) -> None:
    bus.run(0.0, 5.0, reason=Reason.JUMPED)
    assert bus.faults(5.0) == []
