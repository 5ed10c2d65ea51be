"""MF4 files of CAN loggers: every field, stored or virtual, finalised or as they come off the card."""

import struct
from datetime import UTC, datetime
from itertools import accumulate
from operator import ne
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from asammdf import MDF, Signal
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from observer_rt.files.canlog.can_log import LogFrame
from observer_rt.files.formats import is_log, open_log
from observer_rt.files.mdf4.bus_frames import start_of
from observer_rt.foundation.errors import UserError
from tests.files.canlog.log_cases import START, log_frames, mixture, write_log
from tests.files.canlog.test_damaged_logs import unless_refused
from tests.files.logger_file import Field, value_of, write_logger_file

MIDNIGHT = START // 10**9 * 10**9
STORED = {"ID": 29, "IDE": 1, "BusChannel": 4, "DataLength": 7, "Dir": 1, "EDL": 1, "BRS": 1, "ESI": 1}
BYTES = {"ID": "<u4", "DataLength": "u1", "DataBytes": "(8,)u1"}
CONSTANT = ("IDE", "BusChannel", "Dir", "EDL", "BRS", "ESI")
ALL_STORED = [Field(name, bits) for name, bits in STORED.items()]


@st.composite
def logger_files(draw: st.DrawFn) -> tuple[list[LogFrame], list[Field]]:
    """Frames, and fields, some of them virtual: the same in every frame."""
    frames = draw(log_frames(".mf4").filter(bool))
    fields = []
    for name, bits in STORED.items():
        values = {value_of(frame, name) for frame in frames}
        if name in CONSTANT and len(values) == 1 and draw(st.booleans()):
            fields.append(Field(name, 0, offset=float(*values)))
        else:
            fields.append(Field(name, bits))
    return frames, draw(st.permutations(fields))


@pytest.mark.parametrize("is_finalised", [True, False])
@pytest.mark.parametrize("data_width", [64, None])
def test_every_field_of_a_logger_is_read(tmp_path: Path, is_finalised: bool, data_width: int | None) -> None:
    path = tmp_path / "card.mf4"

    @settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.too_slow])
    @given(logger_files())
    def check(made: tuple[list[LogFrame], list[Field]]) -> None:
        frames, fields = made
        write_logger_file(path, frames, fields, MIDNIGHT, is_finalised, 2, data_width)
        content = path.read_bytes()
        log = open_log(path)
        assert (list(log), log.error_frames, path.read_bytes()) == (frames, 2, content)

    check()


def test_what_asammdf_makes_of_a_card_is_read_the_same(tmp_path: Path) -> None:
    """It finalises the file and stores the constant fields as virtual channels."""
    frames = [frame._replace(channel="3") for frame in mixture(".mf4", 50)]
    fields = [field for field in ALL_STORED if field.name != "BusChannel"] + [Field("BusChannel", 0, offset=3)]
    card, saved = tmp_path / "card.mf4", tmp_path / "saved.mf4"
    write_logger_file(card, frames, fields, MIDNIGHT)
    with MDF(card) as file:
        file.save(saved, compression=2)
    assert saved.read_bytes().startswith(b"MDF ")
    assert list(open_log(saved)) == list(open_log(card)) == frames


def test_frames_of_several_groups_in_order_of_time(tmp_path: Path) -> None:
    """As where each bus has a group of its own; a step back of time within one is noted."""
    path = tmp_path / "stacked.mf4"
    frames = mixture(".mf4", 300)
    parts = [[f for f in frames if f.channel == channel] for channel in "12"]
    paths = [tmp_path / f"part{channel}.mf4" for channel in "12"]
    for first in (parts[0], parts[0][30:] + parts[0][:30]):
        for part, part_path in zip((first, parts[1]), paths, strict=True):
            write_logger_file(part_path, part, ALL_STORED, MIDNIGHT)
        with MDF.stack(paths) as file:
            file.save(path, overwrite=True)
        reached = accumulate((frame.frame.stamp_ns for frame in first), max)
        others = ((frame.frame.stamp_ns, frame) for frame in parts[1])
        in_order = sorted([*zip(reached, first, strict=True), *others], key=lambda pair: pair[0])
        log = open_log(path)
        assert [entry.frame.payload for entry in log] == [frame.frame.payload for _, frame in in_order]
        assert any("time on 1 steps back by" in note for note in log.notes()) == (first != parts[0])


def test_text_for_a_direction_and_a_length_without_its_field(tmp_path: Path) -> None:
    path = tmp_path / "text.mf4"
    time = np.arange(3) / 10
    values = {
        "ID": np.array([1, 2, 0x80000003], "u4"),
        "DLC": np.array([0, 8, 9], "u1"),
        "Dir": np.array([1, 0, 1], "u1"),
        "BusChannel": np.ones(3, "u1"),
        "DataBytes": np.ones((3, 12), "u1"),
    }
    conversions = {
        "Dir": {"val_0": 1, "text_0": "Rx", "val_1": 0, "text_1": "Tx"},  # not the usual way round
        "BusChannel": {"val_0": 1, "text_0": "of the engine"},  # the number counts
    }
    signals = [
        Signal(samples, time, name=f"CAN_DataFrame.{name}", conversion=conversions.get(name))
        for name, samples in values.items()
    ]
    signals.append(Signal(np.zeros(3, "u1"), time, name="CAN_DataFrame"))
    with MDF(version="4.10") as file:
        file.append(signals, common_timebase=True)
        file.groups[0].channel_group.flags |= 0x6
        file.save(path)
    frames = [(f.frame.frame_id, f.frame.is_extended, f.frame.is_fd, f.is_sent, f.channel) for f in open_log(path)]
    assert frames == [(1, False, False, False, "1"), (2, False, False, True, "1"), (3, True, True, False, "1")]
    assert [len(entry.frame.payload) for entry in open_log(path)] == [0, 8, 12]


@pytest.mark.parametrize("factor", [-1e-9, 1.0, float("nan")])
def test_times_that_a_damaged_conversion_makes_impossible_are_refused(tmp_path: Path, factor: float) -> None:
    path = tmp_path / "card.mf4"
    frames = [
        frame._replace(frame=frame.frame._replace(stamp_ns=n * 10**18)) for n, frame in enumerate(mixture(".mf4", 9))
    ]
    write_logger_file(path, frames, ALL_STORED, 0)
    data = path.read_bytes()
    path.write_bytes(data.replace(struct.pack("<d", 1e-9), struct.pack("<d", factor)))
    with pytest.raises(UserError, match="times before 1970, or after 2262"):
        list(open_log(path))


def test_a_channel_that_is_no_number(tmp_path: Path) -> None:
    path = tmp_path / "card.mf4"
    fields = [field for field in ALL_STORED if field.name != "BusChannel"] + [Field("BusChannel", 0, offset=2.5)]
    write_logger_file(path, mixture(".mf4", 5), fields, MIDNIGHT)
    with pytest.raises(UserError, match=r"damaged MDF file: ValueError: the BusChannel of its frames is 2\.5"):
        list(open_log(path))


def test_an_offset_outside_the_data_does_not_end_this_process(tmp_path: Path) -> None:
    path = tmp_path / "card.mf4"
    write_logger_file(path, mixture(".mf4", 200), ALL_STORED, MIDNIGHT)
    with MDF(path) as file:
        file.save(tmp_path / "saved.mf4")
    data = (tmp_path / "saved.mf4").read_bytes()
    offset = struct.pack("<Q", sum(4 + len(each.frame.payload) for each in mixture(".mf4", 200)[:-1]))
    assert data.count(offset) >= 1
    (tmp_path / "saved.mf4").write_bytes(data.replace(offset, struct.pack("<Q", 1 << 40)))
    with pytest.raises(UserError, match="a damaged MDF file"):
        list(open_log(tmp_path / "saved.mf4"))


def test_lengths_in_data_that_stand_apart_are_followed(tmp_path: Path) -> None:
    """A shorter length gives a frame fewer bytes, and no other one those of another; a longer one is refused."""
    card, path = tmp_path / "card.mf4", tmp_path / "saved.mf4"
    frames = mixture(".mf4", 8)
    write_logger_file(card, frames, ALL_STORED, MIDNIGHT)
    with MDF(card) as file:
        file.save(path, compression=0)
    data = path.read_bytes()
    lengths = [len(frame.frame.payload) for frame in frames]
    stored = b"".join(
        struct.pack("<I", length) + frame.frame.payload for length, frame in zip(lengths, frames, strict=True)
    )
    assert list(open_log(path)) == frames
    position = data.index(stored)
    for length in lengths:
        for change in (1, 4, 1 << 20):
            damaged = bytearray(data)
            struct.pack_into("<I", damaged, position, length ^ change)
            path.write_bytes(damaged)
            entries = unless_refused(path, lambda: list(open_log(path)))
            assert entries is None or sum(map(ne, entries, frames)) <= 1
        position += 4 + length


def asammdf_log(path: Path, is_invalid: list[bool]) -> None:
    """Frames of eight bytes by asammdf, their identifiers counting up."""
    count = len(is_invalid)
    frames = np.zeros(count, [(f"CAN_DataFrame.{name}", kind) for name, kind in BYTES.items()])
    frames["CAN_DataFrame.ID"], frames["CAN_DataFrame.DataLength"] = range(count), 8
    bits = np.array(is_invalid) if any(is_invalid) else None
    with MDF(version="4.10") as file:
        file.append(Signal(frames, np.arange(count) / 100, name="CAN_DataFrame", invalidation_bits=bits))
        file.save(path)


def test_frames_that_the_heading_does_not_count_are_told(tmp_path: Path) -> None:
    path = tmp_path / "bus.mf4"
    asammdf_log(path, [False] * 12)
    data = bytearray(path.read_bytes())
    count = data.index(b"##CG") + 24 + 6 * 8 + 8
    assert data[count] == 12
    data[count] = 5
    path.write_bytes(data)
    log = open_log(path)
    assert len(list(log)) == 5
    assert log.notes() == [f"{path}: its heading leaves out 7 frames that are in it: it may be damaged"]


def test_an_older_mdf_is_named(tmp_path: Path) -> None:
    path = write_log(tmp_path / "old.mf4", mixture(".mf4", 3))
    path.write_bytes(path.read_bytes().replace(b"MDF     4.10", b"MDF     3.30", 1))
    with pytest.raises(UserError, match=r"is of MDF 3\., not 4"):
        is_log(path)


def test_identifiers_of_more_than_11_bits_are_extended_where_nothing_says_so(tmp_path: Path) -> None:
    path = tmp_path / "card.mf4"
    frames = mixture(".mf4", 20)
    fields = [Field("ID", 32), *(field for field in ALL_STORED if field.name not in ("ID", "IDE"))]
    write_logger_file(path, frames, fields, MIDNIGHT)
    expected = [(f.frame.frame_id, f.frame.frame_id > 0x7FF) for f in frames]
    assert [(f.frame.frame_id, f.frame.is_extended) for f in open_log(path)] == expected


def test_a_start_in_local_time_is_read_by_the_zone_of_this_computer() -> None:
    moment = datetime(2024, 7, 1, 12, 30, 15)
    as_utc = int(moment.replace(tzinfo=UTC).timestamp()) * 10**9 + 5
    for flags, start in ((0, as_utc), (2, as_utc), (1, int(moment.timestamp()) * 10**9 + 5)):
        header = SimpleNamespace(abs_time=as_utc, time_flags=flags)
        assert start_of(SimpleNamespace(header=header)) == start


def test_frames_marked_as_invalid_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "invalid.mf4"
    asammdf_log(path, [n in (5, 6, 7) for n in range(20)])
    log = open_log(path)
    assert [entry.frame.frame_id for entry in log] == [n for n in range(20) if not 5 <= n <= 7]
    assert log.other_entries == 3


@pytest.mark.parametrize("is_finalised", [True, False])
def test_what_asammdf_drops_behind_an_unknown_record_is_told(tmp_path: Path, is_finalised: bool) -> None:
    path = tmp_path / "card.mf4"
    write_logger_file(path, mixture(".mf4", 20), ALL_STORED, MIDNIGHT, is_finalised, data_width=64)
    data = bytearray(path.read_bytes())
    size = (len(data) - data.rindex(b"##DT") - 24) // 20
    data[data.rindex(b"##DT") + 24 + 10 * size] = 77
    path.write_bytes(data)
    log = open_log(path)
    assert len(list(log)) == 10
    assert any("are not of whole records" in note for note in log.notes())
