"""What is wrong: which message, since when, what to do."""

from pathlib import Path

import pytest

from observer_rt.bus.links.link import BusFrame, Frame
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.bus.mapping.output_signals import StatusValues
from observer_rt.config.bench import load_bench
from observer_rt.desk.live_page.injector import Fault, Seen, WatchedInjector
from observer_rt.engine.service.messages import FrameWriter, OutputFrame
from observer_rt.engine.stream.state import Reason, State
from observer_rt.engine.words import REASONS
from observer_rt.files.replay.framing import Span, TimedFrame
from tests.benches import THREE_MESSAGES, sample_bench
from tests.device import Device, simulated

SECOND = 1_000_000_000
BEGIN = 1_780_000_000 * SECOND


class Bus:
    """Devices and an observer at work, some of which are switched off now and then."""

    def __init__(self, folder: Path, extra: str = "") -> None:
        bench = load_bench(sample_bench(folder, THREE_MESSAGES, extra))
        self._injector = WatchedInjector(bench)
        self._injector.begin(BEGIN)
        self._frames = list(Device(bench).send(simulated(), Span(0, 56)))
        self._bus = map_bus(bench)
        self._status = FrameWriter(self._bus.status)
        self._now = BEGIN

    def run(
        self,
        end: float,
        without: str | tuple[str, ...] = (),
        state: State = State.ADAPTED,
        reason: Reason = Reason.NONE,
    ) -> None:
        """Frames every 100 ms up to a time [s], but for those of a message."""
        names = {
            layout.frame_id: layout.name for layout in (*self._bus.input_layouts, self._bus.status.layout)
        }
        away = (without,) if isinstance(without, str) else without
        values = dict.fromkeys(StatusValues._fields, 0) | {"state": state, "reason": reason}
        while self._now < BEGIN + round(end * SECOND):
            status = self._status.write(StatusValues(**values))  # type: ignore[arg-type]
            sent: list[TimedFrame | OutputFrame] = [*self._frames, *status]
            for each in sent:
                if names[each.frame_id] not in away:
                    came = BusFrame(0, Frame(each.frame_id, each.payload, self._now))
                    self._injector.take(came, self._now)
            self._now += SECOND // 10

    def faults(self) -> list[tuple[str, float, str]]:
        """What is wrong now: what, since when [s], what to do."""
        return [(each.what, (each.since - BEGIN) / SECOND, each.remedy) for each in self.seen_faults()]

    def seen_faults(self) -> tuple[Fault, ...]:
        """The same as the page has them."""
        return self.seen().faults

    def seen(self) -> Seen:
        """All the page has."""
        return self._injector.seen(self._now)


@pytest.fixture
def bus(tmp_path: Path) -> Bus:
    return Bus(tmp_path)


@pytest.mark.parametrize("reason", [Reason.NONE, Reason.JUMPED])
def test_all_is_well_also_with_a_source_that_sends_windows(bus: Bus, reason: Reason) -> None:
    bus.run(5.0, reason=reason)
    assert bus.faults() == []


def test_a_message_that_stays_away_is_named_with_its_signal(bus: Bus) -> None:
    bus.run(3.0)
    bus.run(6.0, without="NeedleLiftBlock")
    ((what, since, remedy),) = bus.faults()
    assert what.startswith("NeedleLiftBlock 0x111 (needle_lift): no frame")
    assert since == pytest.approx(2.9, abs=0.15)
    assert "cable" in remedy
    bus.run(6.2)
    assert bus.faults() == []


def test_messages_that_stay_away_together_are_one_fault_that_lists_them(bus: Bus) -> None:
    """What the observer says of it is no second one."""
    bus.run(3.0)
    away = tuple(THREE_MESSAGES.values())
    bus.run(6.0, without=away, state=State.WAITING_FOR_DATA, reason=Reason.INPUT_TIMEOUT)
    (fault,) = bus.seen_faults()
    assert fault.what == "no frame of any input for 3 s"
    assert [part.split()[0] for part in fault.parts] == list(away)


def test_without_the_observer_one_is_told_to_start_it(bus: Bus) -> None:
    bus.run(4.0, without="ObserverStatus")
    ((what, since, remedy),) = bus.faults()
    assert what.startswith("ObserverStatus")
    assert since == 0.0
    assert "observer-rt run" in remedy


def test_what_the_observer_said_before_it_fell_silent_is_no_fault_of_now(bus: Bus) -> None:
    bus.run(4.0, state=State.DEGRADED, reason=Reason.MODEL_INADEQUATE)
    assert bus.seen().silent_since is None
    bus.run(5.5, without="ObserverStatus")
    assert bus.seen().silent_since is not None
    ((what, since, _),) = bus.faults()
    assert what.startswith("ObserverStatus")
    assert since == pytest.approx(3.9, abs=0.15)


def test_an_observer_that_seldom_sends_its_status_is_not_silent_between(tmp_path: Path) -> None:
    slow = Bus(tmp_path, "[outputs]\nstatus_period_ms = 2000\n")
    slow.run(3.0)
    slow.run(8.0, without="ObserverStatus")
    assert slow.faults() == []
    slow.run(10.0, without="ObserverStatus")
    assert slow.seen().silent_since is not None


def test_a_bad_state_is_told_once_it_lasts(bus: Bus) -> None:
    bus.run(2.0)
    bus.run(2.5, state=State.DEGRADED, reason=Reason.MODEL_INADEQUATE)
    assert bus.faults() == []
    bus.run(4.0, state=State.DEGRADED, reason=Reason.MODEL_INADEQUATE)
    ((what, _, remedy),) = bus.faults()
    assert what == f"MODEL_INADEQUATE: {REASONS[Reason.MODEL_INADEQUATE].what}"
    assert remedy == REASONS[Reason.MODEL_INADEQUATE].remedy
