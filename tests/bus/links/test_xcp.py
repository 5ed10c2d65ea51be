"""An ECU measured by XCP on CAN: what is asked of it, the samples its link hands over, and what ends in words."""

import struct
import time
from collections.abc import Iterator
from typing import Any
from uuid import uuid4

import can
import pytest

from observer_rt.bus.database.measurements import measurements
from observer_rt.bus.links.link import Frame, LinkDownError
from observer_rt.bus.links.opening import open_link
from observer_rt.bus.links.python_can import PythonCanLink
from observer_rt.bus.links.xcp import SILENCE, XcpLink
from observer_rt.config.xcp import MESSAGE, XcpConfig
from observer_rt.foundation.errors import RunError
from tests.xcp_ecu import EVENT, MASTER, SLAVE, Ecu

RATE = 10e3
NAMES = {
    "rail": (0x2000_0000, "UWORD"),
    "lift": (0x2000_0010, "SWORD"),
    "line": (0x2000_0020, "FLOAT32_IEEE"),
}
LAYOUT = "Hhf"


def config(**others: object) -> XcpConfig:
    named = {
        name: {"address": address, "type": kind, "factor": 0.5 if name == "rail" else 1.0, "unit": "bar"}
        for name, (address, kind) in NAMES.items()
    }
    stated = {"master_id": MASTER, "slave_id": SLAVE, "event": EVENT, "rate_hz": RATE, "measurements": named}
    return XcpConfig.model_validate(stated | others)


def memory(order: str, rail: int, lift: int, line: float) -> dict[int, bytes]:
    values = (
        struct.pack(f"{order}{kind}", value) for kind, value in zip(LAYOUT, (rail, lift, line), strict=True)
    )
    return {address: value for (address, _), value in zip(NAMES.values(), values, strict=True)}


@pytest.fixture
def channel() -> str:
    return f"test-{uuid4()}"


@pytest.fixture
def bus(channel: str) -> Iterator[can.BusABC]:
    with can.Bus(interface="virtual", channel=channel, fd=True) as bus:
        yield bus


def xcp_link(channel: str, asked: XcpConfig | None = None) -> XcpLink:
    return XcpLink(open_link("virtual", channel, True, [(SLAVE, False)]), asked or config())


def taken(link: XcpLink, count: int) -> list[Frame]:
    frames = [link.receive(1.0) for _ in range(count)]
    assert link.receive(0.0) is None
    return [frame for frame in frames if frame is not None]


def decoded(frame: Frame) -> dict[str, float]:
    assert (frame.frame_id, frame.is_extended) == (config().sample_id, True)
    message = measurements(config()).get_message_by_name(MESSAGE)
    values = message.decode(frame.payload, decode_choices=False)
    assert isinstance(values, dict)
    return {name: float(value) for name, value in values.items()}


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize(("max_dto", "stamp_size"), [(8, 2), (8, 4), (64, 4)])
def test_samples_come_with_their_values_whatever_the_ecu_sends_them_in(
    channel: str, bus: can.BusABC, order: str, max_dto: int, stamp_size: int
) -> None:
    with (
        Ecu(bus, memory(order, 0, 0, 0.0), order, max_dto, stamp_size, tick_us=20) as ecu,
        xcp_link(channel) as link,
    ):
        for n in range(300):  # 5 ticks of 20 us from sample to sample
            ecu.happen(1000 + 5 * n, memory(order, 100 + n, n - 150, 0.25 * n))
        samples = [decoded(frame) for frame in taken(link, 300)]
    assert samples == [
        {"SampleIndex": n, "rail": 0.5 * (100 + n), "lift": n - 150, "line": 0.25 * n} for n in range(300)
    ]


def test_stamps_that_scatter_about_the_event_number_samples_as_they_are(
    channel: str, bus: can.BusABC
) -> None:
    values = memory("<", 1, 2, 3.0)
    with Ecu(bus, values) as ecu, xcp_link(channel) as link:
        for n in range(50):
            ecu.happen(10 * n + 5 + (0 if n == 0 else (-4, 4)[n % 2]))  # 10 ticks of 10 us a sample
        assert [decoded(frame)["SampleIndex"] for frame in taken(link, 50)] == list(range(50))


def test_an_event_of_which_a_packet_is_lost_is_a_lost_sample(channel: str, bus: can.BusABC) -> None:
    values = memory("<", 1, 2, 3.0)
    with Ecu(bus, values) as ecu, xcp_link(channel) as link:
        ecu.happen(0)
        bus.send(
            can.Message(
                arbitration_id=SLAVE,
                data=b"\0" + (10).to_bytes(2, "little") + b"\1\0\2\0",
                is_extended_id=False,
            )
        )
        ecu.happen(20)
        assert [decoded(frame)["SampleIndex"] for frame in taken(link, 2)] == [0, 2]


class LaterLink(PythonCanLink):
    """A link whose receive stamps are later, by `later_ns`."""

    later_ns = 0

    def receive(self, timeout_s: float) -> Frame | None:
        frame = super().receive(timeout_s)
        return None if frame is None else frame._replace(stamp_ns=frame.stamp_ns + self.later_ns)


def test_a_gap_longer_than_the_stamps_reach_is_told_by_the_receive_stamps(
    channel: str, bus: can.BusABC
) -> None:
    below = LaterLink("virtual", channel, True, [(SLAVE, False)])
    end = 600  # ms; the stamps begin anew every 256 ms
    with (
        Ecu(bus, memory("<", 1, 2, 3.0), stamp_size=1, tick_us=1000) as ecu,
        XcpLink(below, config(rate_hz=1e3)) as link,
    ):
        ecu.happen(0)
        indices = [decoded(frame)["SampleIndex"] for frame in taken(link, 1)]
        below.later_ns = end * 1_000_000
        ecu.happen(end)
        indices += [decoded(frame)["SampleIndex"] for frame in taken(link, 1)]
    assert indices == [0, end]


def test_what_others_send_passes(channel: str, bus: can.BusABC) -> None:
    link = open_link("virtual", channel, True, [(SLAVE, False), (0x200, False)])
    with Ecu(bus, memory("<", 1, 2, 3.0)), XcpLink(link, config()) as measured:
        bus.send(can.Message(arbitration_id=0x200, data=b"other", is_extended_id=False))
        frame = measured.receive(1.0)
        assert frame is not None
        assert (frame.frame_id, frame.payload) == (0x200, b"other")
        time.sleep(SILENCE)  # of the ECU
        bus.send(can.Message(arbitration_id=0x200, data=b"other", is_extended_id=False))
        with pytest.raises(LinkDownError, match="no measurements any more"):
            measured.receive(1.0)


def test_the_ecu_is_left_as_it_was_found(channel: str, bus: can.BusABC) -> None:
    with Ecu(bus, memory("<", 1, 2, 3.0)) as ecu:
        with xcp_link(channel):
            assert ecu.running.is_set()
        assert not ecu.running.is_set()
        assert ecu.commands[-1] == b"\xfe"


@pytest.mark.parametrize(
    ("ecu", "asked", "problem"),
    [
        ({"is_locked": True}, {}, "seed and key"),
        ({"properties": 0x10}, {}, "dynamic DAQ"),
        ({"properties": 0x01}, {}, "stamp its measurements"),
        ({"stamp_size": 0}, {}, "stamp its measurements"),
        ({"stamp_size": 1}, {}, "for 50 ms without beginning anew"),
        ({}, {"event": EVENT + 1}, "refuses SET_DAQ_LIST_MODE with error 0x22"),
        (
            {},
            {"measurements": {"gone": {"address": 1, "type": "UBYTE"}}},
            "refuses WRITE_DAQ with error 0x22",
        ),
        (
            {"stamp_size": 4},
            {"measurements": {"line": {"address": 0x2000_0020, "type": "FLOAT32_IEEE"}}},
            "does not fit beside the ECU's stamp",
        ),
    ],
)
def test_an_ecu_that_cannot_is_refused_with_the_reason(
    channel: str, bus: can.BusABC, ecu: dict[str, Any], asked: dict[str, object], problem: str
) -> None:
    with Ecu(bus, memory("<", 1, 2, 3.0), **ecu), pytest.raises(RunError, match=problem) as refused:
        xcp_link(channel, config(**asked))
    assert not isinstance(refused.value, LinkDownError)


def test_an_ecu_that_is_switched_off_is_waited_for_and_asked_anew(channel: str, bus: can.BusABC) -> None:
    values = memory("<", 1, 2, 3.0)
    with Ecu(bus, values, is_silent=True) as ecu:
        with pytest.raises(LinkDownError, match="does not answer CONNECT"):
            xcp_link(channel)
        ecu.is_silent = False
        with xcp_link(channel) as link:
            ecu.happen(0)
            assert len(taken(link, 1)) == 1
            ecu.running.clear()  # it was restarted
            with pytest.raises(LinkDownError, match="no measurements any more"):
                link.receive(1.1)
            link.reconnect()
            assert ecu.running.is_set()
            ecu.happen(777)
            assert [decoded(frame)["SampleIndex"] for frame in taken(link, 1)] == [0]
