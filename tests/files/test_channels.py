"""Which channel of a log is which bus: by name, by number, or as said; else a clear question."""

from pathlib import Path

import pytest

from observer_rt.bus.links.link import Frame
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.config.bench_file import LinkConfig, NamedLink
from observer_rt.files.canlog.can_log import LogFrame
from observer_rt.files.channels import InputFrames, chosen_channels
from observer_rt.files.formats import open_writer
from observer_rt.foundation.errors import UserError
from tests.bus.extended_bench import write_extended_bench
from tests.files.canlog.log_cases import START, write_log

BENCH = [NamedLink(name, LinkConfig(channel=f"can{n}")) for n, name in enumerate(("", "lift", "out"))]
INPUTS = {0, 1}


def log(folder: Path, suffix: str, *channels: str) -> Path:
    path = folder / f"bus{suffix}"
    with open_writer(path, 1_000_000_000) as writer:
        for n, channel in enumerate(channels):
            writer.write(LogFrame(Frame(0x100 + n, b"\1", 1_000_000_000 + n * 1_000_000, False, False), channel))
    return path


@pytest.mark.parametrize(
    ("suffix", "channels", "result"),
    [
        (".log", ("can1", "can0", "can7"), {0: "can0", 1: "can1"}),
        (".log", ("can2", "can1", "can0"), {0: "can0", 1: "can1", 2: "can2"}),
        (".blf", ("can2", "can0", "can1"), {0: "1", 1: "2", 2: "3"}),
    ],
)
def test_channels_are_matched(tmp_path: Path, suffix: str, channels: tuple[str, ...], result: dict[int, str]) -> None:
    assert chosen_channels(log(tmp_path, suffix, *channels), BENCH, INPUTS, ()) == result


def test_what_is_said_counts(tmp_path: Path) -> None:
    path = log(tmp_path, ".log", "vcan0", "vcan1", "can1")
    assert chosen_channels(path, BENCH, INPUTS, ("vcan0",)) == {0: "vcan0", 1: "can1"}
    assert chosen_channels(path, BENCH, INPUTS, ("vcan0", "lift=vcan1")) == {0: "vcan0", 1: "vcan1"}
    assert chosen_channels(path, BENCH, INPUTS, ("vcan0", "lift=vcan0")) == {0: "vcan0", 1: "vcan0"}


def test_a_bench_with_one_bus_takes_any_channel(tmp_path: Path) -> None:
    path = tmp_path / "nowhere.log"  # is not even read
    assert chosen_channels(path, BENCH[:1], {0}, ()) == {0: None}
    assert chosen_channels(path, BENCH[:1], {0}, ("can4",)) == {0: "can4"}


@pytest.mark.parametrize(
    ("suffix", "channels"), [(".log", ("vcan0", "vcan1")), (".log", ("can0",)), (".blf", ("3", "5"))]
)
def test_where_it_is_not_clear_the_remedy_says_how(tmp_path: Path, suffix: str, channels: tuple[str, ...]) -> None:
    said = rf"is not clear.*{'.*'.join(channels)}(?s:.*) --from-channel CHANNEL --from-channel lift=CHANNEL$"
    with pytest.raises(UserError, match=said):
        chosen_channels(log(tmp_path, suffix, *channels), BENCH, INPUTS, ())


OTHER = 0x18FEF2FE


@pytest.mark.parametrize(
    ("identifier", "remedy"),
    [
        (0x18FEF100, f"; or, if this is J1939, 0x18FEF100 .* set the identifier of Daq .* {0x18FEF100 | 1 << 31}$"),
        (0x0CFEF1FE, "; or, if this is J1939, 0xCFEF1FE"),
        (0x18FEF0FE, "recorded by$"),
    ],
)
def test_a_log_without_frames_of_a_bench_says_what_it_has(tmp_path: Path, identifier: int, remedy: str) -> None:
    write_log(tmp_path / "bus.blf", [LogFrame(Frame(identifier, bytes(8), START, True, False), "1")])
    frames = InputFrames(tmp_path / "bus.blf", map_bus(load_bench(write_extended_bench(tmp_path))), {0: None})
    with pytest.raises(UserError, match=rf"(?s)no frame of Daq \(0x18FEF1FE\); it has 0x{identifier:X}.*{remedy}"):
        list(frames)


def test_an_identifier_of_the_other_size_is_named(tmp_path: Path) -> None:
    frames = [LogFrame(Frame(0x100, bytes(64), START + n * 1000, True, True), "1") for n in range(3)]
    write_log(tmp_path / "bus.blf", frames)
    said = r"(?s)SampleBlock \(0x100\); it has 0x100 of 29 bits.*correct the size of the identifier of SampleBlock"
    with pytest.raises(UserError, match=said):
        list(InputFrames(tmp_path / "bus.blf", map_bus(load_bench()), {0: None}))
