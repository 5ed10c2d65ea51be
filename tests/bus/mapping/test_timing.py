"""What the bench file says of time: how each message is joined, and refusals that name place and remedy."""

from pathlib import Path

import pytest

from observer_rt.bus.mapping.bus_map import BusMap, map_bus, stream_of
from observer_rt.bus.mapping.input_tables import ROLES
from observer_rt.config.bench import load_bench
from observer_rt.config.signals import Role
from observer_rt.core.frames.frames import Joining, Numbering
from observer_rt.foundation.errors import UserError
from tests.daemon.time_frames import write_time_bench

RATE = 20e3
LINE_LIFT = 'message = "LineLift"'


def timed(folder: Path, rail: str, line: str = LINE_LIFT, lift: str = LINE_LIFT) -> BusMap:
    return map_bus(load_bench(write_time_bench(folder, RATE, {"Line": line, "Lift": lift, "Rail": rail})))


@pytest.mark.parametrize(
    ("rail", "joining", "numbering"),
    [
        ('message = "RailSlow"', Joining.INDEX, Numbering.INDEX),
        ('message = "RailSlow"\nrate_hz = 1e3', Joining.RATIO, Numbering.INDEX),
        ('message = "RailSlow"\ntime_base = "ecu"', Joining.CLOCK, Numbering.INDEX),
        ('message = "RailSlow"\ntime_base = "ecu"\nrate_hz = 1e3', Joining.CLOCK, Numbering.INDEX),
        ('message = "RailSlow"\nindex = ""', Joining.NEAREST, Numbering.STAMPS),
        ('message = "Rail"', Joining.NEAREST, Numbering.STAMPS),
        ('message = "Rail"\nrate_hz = 1e3', Joining.CLOCK, Numbering.STAMPS),
    ],
)
def test_how_the_rail_pressure_is_joined(tmp_path: Path, rail: str, joining: Joining, numbering: Numbering) -> None:
    bus = timed(tmp_path, rail)
    row = bus.inputs.timing[stream_of(bus, Role.RAIL_PRESSURE)]
    line = bus.inputs.timing[stream_of(bus, Role.LINE_PRESSURE)]
    assert (row["joining"], row["numbering"]) == (joining, numbering)
    assert line["joining"] == Joining.INDEX
    # s that its time may be unknown by: it changes slowly; of a slow one a tenth of its interval
    assert (row["tolerance"], line["tolerance"]) == pytest.approx((100e-6 if "rate_hz" in rail else 20e-6, 2e-6))
    follows = bus.grid_relations[stream_of(bus, Role.RAIL_PRESSURE)]
    assert (follows is None) == (joining in (Joining.INDEX, Joining.NEAREST))


def test_counter_and_its_modulus(tmp_path: Path) -> None:
    for name, modulus in (("Nibble", 16), ("Count", 256)):
        lines = f'message = "All"\ncounter = "{name}"'
        bus = timed(tmp_path, lines, lines, lines)
        assert (len(bus.inputs.timing), bus.inputs.timing[0]["numbering"]) == (1, Numbering.COUNTER)
        assert bus.inputs.timing[0]["modulus"] == modulus


def test_slower_signal_is_held_for_two_and_a_half_frames_unless_stated(tmp_path: Path) -> None:
    rail = 'message = "Rail"\ntime_base = "ecu"\nrate_hz = 1e3\n'
    for lines, reach in ((rail, 50.0), (rail + "max_hold_ms = 4", 80.0)):
        bus = timed(tmp_path, lines)
        follows = bus.grid_relations[stream_of(bus, Role.RAIL_PRESSURE)]
        assert follows is not None
        assert follows.reach == pytest.approx(reach)


@pytest.mark.parametrize(
    ("key", "value", "further", "problem"),
    [
        ("counter", '"Cont"', "", "Cont"),
        ("counter", '"Rail"', "", "unsigned"),
        ("rate_hz", 3e3, "", "whole fraction"),
        ("rate_hz", 40e3, "", "whole fraction"),
        ("max_hold_ms", 0.5, "rate_hz = 1e3\n", "shorter"),
        ("max_hold_ms", 500, "rate_hz = 1e3\n", "wait"),
        ("rate_hz", 10, "", "wait"),
    ],
)
def test_refusals_of_rail_pressure(tmp_path: Path, key: str, value: str | float, further: str, problem: str) -> None:
    with pytest.raises(UserError, match=rf"signals\.rail_pressure\.{key}: .*{problem}.*\n  remedy: ."):
        timed(tmp_path, f'message = "Rail"\n{further}{key} = {value}')


@pytest.mark.parametrize(
    ("rail", "moved"),
    [
        ('message = "RailSlow"\nfilter_delay_us = 120', 2.4),
        ('message = "RailSlow"\nrate_hz = 1e3\nfilter_delay_us = 120', 2.4),
        ('message = "Rail"\nfilter_delay_us = 120', 2.4),
        ('message = "RailSlow"\ntime_base = "ecu"', 0.0),
    ],
)
def test_a_stated_delay_moves_the_samples(tmp_path: Path, rail: str, moved: float) -> None:
    """At 20 kHz; the line pressure, which is the grid, stays."""
    bus = timed(tmp_path, rail, line=LINE_LIFT, lift=f"{LINE_LIFT}\nfilter_delay_us = 30")
    rail_relation, lift = (bus.grid_relations[stream_of(bus, r)] for r in (Role.RAIL_PRESSURE, Role.NEEDLE_LIFT))
    assert rail_relation is not None
    assert rail_relation.early == pytest.approx(moved)
    assert lift is not None
    assert lift.early == pytest.approx(0.6)
    assert lift.on_grid
    assert lift.roles == 1 << ROLES.index(Role.NEEDLE_LIFT)
