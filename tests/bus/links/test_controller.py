"""Error frames as linux/can/error.h describes them: what they make of the bus's condition, and how it is reported."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.bus.links.controller import BusCondition, BusState, after_error_frame, condition_messages

ERROR_FLAG = 0x20000000
CONTROLLER, BUS_OFF, RESTARTED, NO_ACKNOWLEDGE = 0x004, 0x040, 0x100, 0x020
NOTHING = bytes(8)


def controller(bits: int) -> tuple[int, bytes]:
    return ERROR_FLAG | CONTROLLER, bytes([0, bits, 0, 0, 0, 0, 0, 0])


def after(*frames: tuple[int, bytes]) -> BusCondition:
    condition = BusCondition()
    for identifier, data in frames:
        condition = after_error_frame(condition, identifier, data)
    return condition


OFF = (ERROR_FLAG | BUS_OFF, NOTHING)
RESTART = (ERROR_FLAG | RESTARTED, NOTHING)


@pytest.mark.parametrize(
    ("bits", "state"),
    [
        (0x04, BusState.WARNING),
        (0x08, BusState.WARNING),
        (0x10, BusState.PASSIVE),
        (0x04 | 0x20, BusState.PASSIVE),
        (0x40, BusState.ACTIVE),
        (0x01, BusState.ACTIVE),  # an overrun says nothing of the state
    ],
)
def test_the_state_a_controller_tells(bits: int, state: BusState) -> None:
    assert after(controller(bits)).state is state


def test_a_state_is_counted_when_it_is_entered() -> None:
    condition = after(controller(0x20), controller(0x10), controller(0x40), controller(0x20), OFF, OFF)
    assert (condition.passives, condition.bus_offs, condition.error_frames) == (2, 1, 6)
    assert condition.state is BusState.OFF


def test_bus_off_lasts_until_the_restart() -> None:
    assert after(OFF, controller(0x01)).state is BusState.OFF
    restarted = after(OFF, RESTART, OFF, RESTART)
    assert (restarted.state, restarted.bus_offs, restarted.restarts) == (BusState.ACTIVE, 2, 2)


def test_overruns_are_counted() -> None:
    assert after(controller(0x01), controller(0x02), controller(0x01 | 0x04)).overruns == 2


@given(identifier=st.integers(0, 2**32 - 1), data=st.binary(max_size=8))
def test_any_error_frame_is_survived_and_counted_once(identifier: int, data: bytes) -> None:
    before = BusCondition(BusState.PASSIVE, 3, 2, 1, 5, 10)
    now = after_error_frame(before, identifier, data)
    assert now.error_frames == before.error_frames + 1
    for name in ("passives", "bus_offs", "restarts", "overruns"):
        assert 0 <= getattr(now, name) - getattr(before, name) <= 1


@pytest.mark.parametrize(
    ("before", "frames", "said"),
    [
        ((), (OFF,), "can3 is bus-off.*\n  remedy: .*sudo ip link set can3 type can restart"),
        ((), (controller(0x20),), "can3 is error-passive.*\n  remedy: .*acknowledges"),
        ((), (OFF, RESTART), "can3 was bus-off and has restarted"),
        ((OFF,), (RESTART,), "has restarted"),
        ((controller(0x20),), (controller(0x40),), "can3 is error-active again"),
        ((), (controller(0x01),), "no room for received frames, 1 times"),
    ],
)
def test_what_is_said(
    before: tuple[tuple[int, bytes], ...], frames: tuple[tuple[int, bytes], ...], said: str
) -> None:
    (message,) = condition_messages("can3", after(*before), after(*before, *frames))
    assert re.search(said, message)


@pytest.mark.parametrize("frames", [(), (controller(0x04),), ((ERROR_FLAG | NO_ACKNOWLEDGE, NOTHING),)])
def test_what_is_not_worth_a_message(frames: tuple[tuple[int, bytes], ...]) -> None:
    assert condition_messages("can3", BusCondition(), after(*frames)) == []
    assert condition_messages("can3", after(OFF), after(OFF)) == []
