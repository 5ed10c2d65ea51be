"""The daemon on an ECU that it measures by XCP: the same rates as from frames that a device sends."""

import struct
import threading
from contextlib import ExitStack
from pathlib import Path
from uuid import uuid4

import can
import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.bus.mapping.bus_map import map_bench, map_bus
from observer_rt.config.bench import load_bench
from observer_rt.daemon.link_opening import LinkOpening, shared_buses
from observer_rt.desk.check.buses import buses_findings
from observer_rt.desk.check.findings import Level
from observer_rt.engine.service.core import Core
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.errors import UserError
from tests.benches import sample_bench
from tests.daemon.participants import HeardDaemon, serving, until
from tests.device import Device, run, simulated
from tests.xcp_ecu import EVENT, MASTER, SLAVE, Ecu

RATE = 10e3  # Hz
MEGAPASCAL, MICROMETRE = 1e6, 1e-6
ADDRESSES = {"rail_pressure": 0x7000_0000, "needle_lift": 0x7000_0004, "line_pressure": 0x7000_0008}
UNITS = {
    "rail_pressure": ("MPa", MEGAPASCAL),
    "needle_lift": ("um", MICROMETRE),
    "line_pressure": ("MPa", MEGAPASCAL),
}


def bench_of(folder: Path, channel: str, interface: str) -> Path:
    """Results on a bus of their own beside that of the ECU; learning in lockstep."""
    named = "".join(
        f'{role} = {{ address = 0x{address:X}, type = "FLOAT32_IEEE", unit = "{UNITS[role][0]}" }}\n'
        for role, address in ADDRESSES.items()
    )
    signals = "".join(
        f'[signals.{role}]\nmessage = "XCP"\nsignal = "{role}"\nlink = "ecu"\n' for role in ADDRESSES
    )
    path = folder / "bench.toml"
    path.write_text(
        f'[link]\ninterface = "virtual"\nchannel = "results-{uuid4()}"\n'
        f'[links.ecu]\ninterface = "{interface}"\nchannel = "{channel}"\n'
        f"[links.ecu.xcp]\nmaster_id = {MASTER}\nslave_id = {SLAVE}\nevent = {EVENT}\nrate_hz = {RATE}\n"
        f"[links.ecu.xcp.measurements]\n{named}"
        f'[[dbc]]\nfile = "observer_fd.dbc"\n{signals}[sampling]\nrate_hz = {RATE}\n[learning]\nlockstep = true\n'
    )
    return path


def memory(recording: Recording, sample: int) -> dict[int, bytes]:
    return {
        address: struct.pack("<f", getattr(recording, role)[sample] / UNITS[role][1])
        for role, address in ADDRESSES.items()
    }


def rates(core: Core) -> NDArray[np.float64]:
    """The last rates [m3/s] that a core estimated; the first samples of all are numbered alike."""
    rows = core.rows(0, core.processed)
    found = np.full(int(rows["index"].max()) + 1, np.nan)
    found[rows["index"]] = rows["injection_rate"]
    return found


def observed(path: Path, recording: Recording, bus: can.BusABC) -> HeardDaemon:
    """The daemon of a bench when the ECU has sent the whole recording."""
    bench = load_bench(path)
    mapped = map_bus(bench)
    ecu = Ecu(bus, memory(recording, 0), max_dto=64, stamp_size=4, tick_us=1)
    with ecu, ExitStack() as stack:
        opening = LinkOpening(
            bench, mapped, shared_buses(bench, [mapped]), lambda _: None, threading.Event(), lambda: None
        )
        daemon = HeardDaemon(bench, *(stack.enter_context(link) for link in opening.links()))
        with serving(daemon):
            for n in range(recording.samples):
                ecu.happen(12_345 + 100 * n, memory(recording, n))
            until(lambda: daemon.core.counters.frames >= recording.samples)
    return daemon


def require_the_same_rates(folder: Path, path: Path, bus: can.BusABC) -> None:
    recording = simulated(rate=RATE)
    daemon = observed(path, recording, bus)
    blocks = sample_bench(folder, rate=RATE)
    own = run(blocks, Device(blocks).send(recording))
    assert daemon.core.counters.lost_samples == 0
    found, expected = rates(daemon.core), rates(own.core)
    common = slice(0, min(len(found), len(expected)))
    assert common.stop > 0.95 * recording.samples
    assert np.array_equal(np.isnan(found[common]), np.isnan(expected[common]))
    assert np.nanmax(expected) > 30e-6  # there was something to compare
    assert np.sqrt(np.nanmean((found[common] - expected[common]) ** 2)) < 0.05e-6


def test_the_same_rates_as_from_a_device(tmp_path: Path) -> None:
    channel = f"ecu-{uuid4()}"
    folder = tmp_path / "blocks"
    folder.mkdir()
    with can.Bus(interface="virtual", channel=channel, fd=True) as bus:
        require_the_same_rates(folder, bench_of(tmp_path, channel, "virtual"), bus)


@pytest.mark.slow
@pytest.mark.vcan
def test_the_same_rates_on_a_real_bus(tmp_path: Path, vcan: str) -> None:
    folder = tmp_path / "blocks"
    folder.mkdir()
    with can.Bus(interface="socketcan", channel=vcan, fd=True) as bus:
        require_the_same_rates(folder, bench_of(tmp_path, vcan, "socketcan"), bus)


def test_check_takes_an_ecu_on_a_classic_bus(tmp_path: Path) -> None:
    path = bench_of(tmp_path, "ecu0", "virtual")
    path.write_text(path.read_text().replace("[links.ecu]\n", "[links.ecu]\nfd = false\n"))
    bench = load_bench(path)
    findings = buses_findings(bench, map_bench(bench))
    assert not [finding for finding in findings if finding.level is Level.ERROR]
    assert any("ecu (ecu0), virtual: in XCP" in finding.text for finding in findings)


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('signal = "line_pressure"', 'signal = "line_pressur"', "has no signal line_pressur"),
        ('type = "FLOAT32_IEEE"', 'type = "FLOAT"', "UWORD"),
    ],
)
def test_what_the_bench_file_cannot_mean_is_refused_at_its_place(
    tmp_path: Path, old: str, new: str, problem: str
) -> None:
    path = bench_of(tmp_path, "ecu", "virtual")
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(UserError) as refused:
        map_bus(load_bench(path))
    assert problem in str(refused.value)
