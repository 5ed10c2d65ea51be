"""The condition of a CAN controller by its error frames, and messages to the user about its changes."""

from dataclasses import dataclass, replace
from enum import IntFlag, StrEnum


class BusState(StrEnum):
    """State of a CAN controller by its error counters (ISO 11898-1)."""

    ACTIVE = "error-active"
    WARNING = "error-warning"  # a counter above 96
    PASSIVE = "error-passive"  # a counter above 127
    OFF = "bus-off"  # the transmit counter above 255: it neither sends nor receives


class ErrorClass(IntFlag):
    """Classes of error frames, as in the identifier of such a frame and in the filter that asks for them."""

    CONTROLLER = 0x004  # its state changed, or it had no room for a frame
    BUS_OFF = 0x040
    RESTARTED = 0x100


_RECEIVE_OVERRUN = 0x01  # Byte 1 of a frame of class CONTROLLER.
_STATES = (  # the worst first: one frame may name several
    (0x10 | 0x20, BusState.PASSIVE),  # by the receive or by the transmit counter
    (0x04 | 0x08, BusState.WARNING),
    (0x40, BusState.ACTIVE),
)


@dataclass(frozen=True)
class BusCondition:
    """State of the controller, and counts since the link was opened.

    `restarts`: returns from bus-off; `overruns`: frames received without room; `error_frames`: all of them.
    """

    state: BusState = BusState.ACTIVE
    passives: int = 0
    bus_offs: int = 0
    restarts: int = 0
    overruns: int = 0
    error_frames: int = 0


def after_error_frame(condition: BusCondition, identifier: int, data: bytes) -> BusCondition:
    """The condition once an error frame of this identifier (with or without its flags) was received."""
    state = condition.state
    overrun = False
    if identifier & ErrorClass.CONTROLLER and len(data) > 1:
        overrun = bool(data[1] & _RECEIVE_OVERRUN)
        state = next((named for bits, named in _STATES if data[1] & bits), state)
    restarted = bool(identifier & ErrorClass.RESTARTED)
    if restarted:
        state = BusState.ACTIVE
    if identifier & ErrorClass.BUS_OFF:
        state = BusState.OFF
    entered = state is not condition.state
    return replace(
        condition,
        state=state,
        passives=condition.passives + (entered and state is BusState.PASSIVE),
        bus_offs=condition.bus_offs + (entered and state is BusState.OFF),
        restarts=condition.restarts + restarted,
        overruns=condition.overruns + overrun,
        error_frames=condition.error_frames + 1,
    )


def condition_messages(channel: str, before: BusCondition, now: BusCondition) -> list[str]:
    """Messages to the user of a SocketCAN `channel` about a change of its condition, with remedies."""
    messages = []
    if now.bus_offs > before.bus_offs and now.state is BusState.OFF:
        messages.append(
            f"{channel} is bus-off: too many of its frames failed, it neither sends nor receives\n"
            "  remedy: check wiring, termination and bit rates; without a restart-ms it stays off: "
            f"sudo ip link set {channel} type can restart"
        )
    elif now.bus_offs > before.bus_offs or now.restarts > before.restarts:
        messages.append(f"{channel} was bus-off and has restarted ({now.restarts} restarts so far)")
    elif now.state is BusState.PASSIVE and now.passives > before.passives:
        messages.append(
            f"{channel} is error-passive: many frames fail on the bus\n"
            "  remedy: check that another node acknowledges, that bit rates and sample points agree, and the "
            "termination"
        )
    elif now.state is BusState.ACTIVE and before.state in (BusState.PASSIVE, BusState.OFF):
        messages.append(f"{channel} is error-active again")
    if now.overruns > before.overruns:
        messages.append(
            f"the controller of {channel} had no room for received frames, {now.overruns} times so far\n"
            "  remedy: nothing else on the processor that serves its interrupt"
        )
    return messages
