"""Input frames of a bench in a log: those of J1939 by their parameter group."""

from pathlib import Path

import pytest

from observer_rt.bus.links.link import Frame
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.desk.evaluation.logged import LoggedSignals
from observer_rt.files.canlog.can_log import LogFrame
from observer_rt.files.channels import InputFrames
from observer_rt.foundation.errors import UserError
from tests.bus.j1939_bench import GROUP, write_j1939_bench
from tests.files.canlog.log_cases import START, write_log

OTHER = 0x18FEF2FE


def input_frames(folder: Path, *identifiers: int, is_j1939: bool = True) -> InputFrames:
    """The input frames of a log with one frame of each identifier."""
    bench = load_bench(write_j1939_bench(folder, is_j1939))
    frames = [
        LogFrame(Frame(identifier, bytes(8), START + n * 1000, True, False), "1")
        for n, identifier in enumerate(identifiers)
    ]
    write_log(folder / "bus.blf", frames)
    return InputFrames(folder / "bus.blf", map_bus(bench), {0: None})


def test_any_source_address_is_heard(tmp_path: Path) -> None:
    found = input_frames(tmp_path, 0x18FEF100, 0x0CFEF100, 0x18FEF200)
    for _ in range(2):  # may be iterated again
        assert [frame.frame_id for _, frame in found] == [GROUP, GROUP]
    assert found.notes() == []


def test_one_of_several_senders_counts_and_that_is_told(tmp_path: Path) -> None:
    found = input_frames(tmp_path, 0x18FEF103, 0x18FEF100, 0x18FEF103)
    assert [frame.stamp_ns - START for _, frame in found] == [0, 2000]
    assert found.notes() == [f"{found.path}: Daq of the source address 0x03 counts, also there are 0x00"]


def test_a_message_that_is_none_of_j1939_is_heard_exactly(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"holds no frame of Daq \(0x18FEF1FE\); it has 0x18FEF100"):
        list(input_frames(tmp_path, 0x18FEF100, is_j1939=False))


def test_frames_that_come_too_seldom_give_the_cause(tmp_path: Path) -> None:
    """Two messages that nothing counts, far slower than the sample rate: none joins the other."""
    input_frames(tmp_path, *[GROUP] * 3)
    database, bench = tmp_path / "user.dbc", tmp_path / "bench.toml"
    lift = ' SG_ Lift : 16|16@1+ (0.1,0) [0|0] "um" Device\n'
    other = f"BO_ {OTHER | 1 << 31} Slow: 8 Device\n{lift}BA_DEF_ BO_"
    database.write_text(database.read_text().replace(lift, "").replace("BA_DEF_ BO_", other, 1))
    text = bench.read_text().replace('message = "Daq"\nsignal = "Lift"', 'message = "Slow"\nsignal = "Lift"')
    bench.write_text(text.replace('counter = "Count"', ""))
    log = tmp_path / "slow.log"
    times = [(10 + n * 0.01, identifier) for n in range(50) for identifier in (GROUP, OTHER)]
    log.write_text("".join(f"({time:.6f}) can0 {identifier:08X}#{'00' * 8}\n" for time, identifier in times))
    with pytest.raises(UserError) as raised:
        LoggedSignals(load_bench(bench), log)
    assert "its 100 input frames give 0 samples" in raised.value.problem
    assert "they come at 204 a second, where sampling.rate_hz is 100000" in raised.value.problem
    assert "set sampling.rate_hz" in raised.value.remedy
