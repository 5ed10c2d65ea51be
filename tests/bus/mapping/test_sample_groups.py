"""Multiplexed inputs of a bench file: which frames carry which samples, and which are refused with a remedy."""

from pathlib import Path

import pytest

from observer_rt.bus.mapping.bus_map import BusMap, map_bus
from observer_rt.config.bench import load_bench
from observer_rt.foundation.errors import UserError
from tests.benches import attributes, own_bench

RAILS = "\n".join(
    f' SG_ Rail{k} m{group} : {bit}|8@1+ (1,0) [0|0] "MPa" Daq'
    for k, (group, bit) in enumerate([(0, 40), (0, 48), (1, 40), (2, 40)])
)
LIFTS = "\n".join(f' SG_ Lift{k} : {32 + 8 * k}|8@1+ (1,0) [0|0] "um" Daq' for k in range(4))
LINES = "\n".join(f' SG_ Line{k} : {64 + 8 * k}|8@1+ (1,0) [0|0] "MPa" Daq' for k in range(4))
DATABASE = f"""VERSION ""
BU_: Daq
BO_ 291 Turns: 12 Daq
 SG_ Mux M : 0|8@1+ (1,0) [0|0] "" Daq
 SG_ Index : 8|32@1+ (1,0) [0|0] "" Daq
 SG_ Late m2 : 64|32@1+ (1,0) [0|0] "" Daq
{RAILS}
 SG_ Always : 56|8@1+ (1,0) [0|0] "MPa" Daq
BO_ 292 Rest: 24 Daq
 SG_ Index : 0|32@1+ (1,0) [0|0] "" Daq
{LIFTS}
{LINES}
{attributes([291, 292])}"""


def bus_with(folder: Path, rail: str, index: str = "Index") -> BusMap:
    rest_signal = 'message = "Rest"\nindex = "Index"\npattern = "{}{{}}"'
    signals = {
        "rail_pressure": f'message = "Turns"\nindex = "{index}"\n{rail}',
        "needle_lift": rest_signal.format("Lift"),
        "line_pressure": rest_signal.format("Line"),
    }
    return map_bus(load_bench(own_bench(folder, DATABASE, signals)))


def refusal(folder: Path, rail: str, index: str = "Index") -> UserError:
    with pytest.raises(UserError) as refused:
        bus_with(folder, rail, index)
    assert refused.value.location.startswith(f"{folder / 'bench.toml'}: signals.rail_pressure")
    assert refused.value.remedy
    return refused.value


def test_a_role_spread_over_groups_is_one_stream_of_blocks(tmp_path: Path) -> None:
    bus = bus_with(tmp_path, 'pattern = "Rail{}"')
    rail = next(n for n, stream in enumerate(bus.inputs.streams) if stream["roles"] == 1)
    groups = [group for group in bus.inputs.groups if group["stream"] == rail]
    assert [(int(g["offset"]), int(g["samples"])) for g in groups] == [(0, 2), (2, 1), (3, 1)]
    message = next(m for m in bus.inputs.messages if m["key"] == 291)
    kinds = bus.inputs.kinds[int(message["first_kind"]) :][: int(message["kind_count"])]
    assert [(int(kind["end"]), int(kind["blank"][0])) for kind in kinds] == [(2, 0), (3, 1), (4, 2)]


@pytest.mark.parametrize(
    "samples",
    [
        '["Rail0", "Rail2", "Rail1", "Rail3"]',  # back to an earlier group
        '["Rail0", "Rail1", "Rail2", "Always"]',  # one that is in every frame
    ],
)
def test_a_list_that_frames_cannot_carry_in_order(tmp_path: Path, samples: str) -> None:
    assert "one frame can carry" in refusal(tmp_path, f"signals = {samples}").problem


def test_an_index_that_some_frames_do_not_carry(tmp_path: Path) -> None:
    assert "Late only with other samples" in refusal(tmp_path, 'pattern = "Rail{}"', "Late").problem


def test_samples_in_turns_without_an_index(tmp_path: Path) -> None:
    error = refusal(tmp_path, 'pattern = "Rail{}"', "")
    assert error.location.endswith("signals.rail_pressure.index")
    assert "no sample index" in error.problem
