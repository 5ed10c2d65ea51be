"""The dialogue with an ECU beside that of pyxcp, which shares no code with it, on the same ECU of the tests."""

from uuid import uuid4

import can
import pytest
from pyxcp.config import create_application_from_config
from pyxcp.master import Master

from observer_rt.bus.links.opening import open_link
from observer_rt.bus.links.xcp import XcpLink
from observer_rt.config.xcp import XcpConfig
from tests.xcp_ecu import EVENT, MASTER, SLAVE, Ecu

MEMORY = {0x2000_0000: b"\1\0", 0x2000_0010: b"\2\0", 0x2000_0020: bytes(4)}
MEASUREMENTS = {
    "rail": {"address": 0x2000_0000, "type": "UWORD"},
    "lift": {"address": 0x2000_0010, "type": "SWORD"},
    "line": {"address": 0x2000_0020, "type": "FLOAT32_IEEE"},
}


def by_peer(channel: str) -> None:
    """What start and stop of the same measurements are to pyxcp, step by step as its examples have it."""
    stated = {
        "interface": "virtual",
        "channel": channel,
        "can_id_master": MASTER,
        "can_id_slave": SLAVE,
        "fd": True,
    }
    with Master("can", config=create_application_from_config({"Transport": {"CAN": stated}})) as peer:
        assert peer.connect().maxDto == 8
        assert not peer.getStatus().resourceProtectionStatus.daq
        assert peer.getDaqResolutionInfo().timestampTicks == 10
        assert str(peer.getDaqProcessorInfo().daqProperties.daqConfigType) == "DYNAMIC"
        peer.startStopSynch(0)
        peer.freeDaq()
        peer.allocDaq(1)
        peer.allocOdt(0, 2)
        peer.allocOdtEntry(0, 0, 2)
        peer.allocOdtEntry(0, 1, 1)
        peer.setDaqPtr(0, 0, 0)
        peer.writeDaq(0xFF, 2, 0, 0x2000_0000)
        peer.writeDaq(0xFF, 2, 0, 0x2000_0010)
        peer.setDaqPtr(0, 1, 0)
        peer.writeDaq(0xFF, 4, 0, 0x2000_0020)
        peer.setDaqListMode(0x10, 0, EVENT, 1, 0)
        assert peer.startStopDaqList(2, 0).firstPid == 0
        peer.startStopSynch(1)
        peer.startStopSynch(0)
        peer.disconnect()


@pytest.mark.parametrize("order", ["<", ">"])
def test_both_say_the_same(order: str) -> None:
    channel = f"test-{uuid4()}"
    with can.Bus(interface="virtual", channel=channel, fd=True) as bus:
        with Ecu(bus, MEMORY, order) as ecu:
            by_peer(channel)
        theirs = ecu.commands
        config = XcpConfig.model_validate(
            {
                "master_id": MASTER,
                "slave_id": SLAVE,
                "event": EVENT,
                "rate_hz": 1e3,
                "measurements": MEASUREMENTS,
            }
        )
        with (
            Ecu(bus, MEMORY, order) as ecu,
            XcpLink(open_link("virtual", channel, True, [(SLAVE, False)]), config),
        ):
            pass
        ours = ecu.commands
    assert ours == theirs
