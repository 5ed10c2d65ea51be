"""BLF objects as Vector's tools write them, made byte by byte, and files whose writer was stopped."""

import struct
import zlib
from pathlib import Path

import pytest

from observer_rt.bus.links.link import Frame
from observer_rt.files.canlog.blf import BlfLog
from observer_rt.files.canlog.can_log import LogFrame
from observer_rt.foundation.errors import UserError

DAY = (2017, 9, 6, 30, 15, 6, 13, 191)  # Saturday
DAY_NS = 1_506_783_973_191_000_000
NANOSECONDS, TEN_MICROSECONDS = 2, 1


def obj(kind: int, body: bytes, time: int = 0, unit: int = NANOSECONDS, version: int = 1) -> bytes:
    stamp = struct.pack("<LHHQ", unit, 0, 0, time) if version == 1 else struct.pack("<LBBHQQ", unit, 0, 0, 0, time, 0)
    header = 16 + len(stamp)
    size = header + len(body)
    return struct.pack("<4sHHLL", b"LOBJ", header, version, size, kind) + stamp + body + bytes(size % 4)


def classic(channel: int = 1, flags: int = 0, dlc: int = 2, identifier: int = 0x100) -> bytes:
    return struct.pack("<HBBL8s", channel, flags, dlc, identifier, bytes(range(8)))


def fd_64(dlc: int, valid: int, flags: int, data: bytes, more: int = 0) -> bytes:
    return struct.pack("<BBBBLLLLLLLHBBL", 3, dlc, valid, 0, 0x8000_1234, 0, flags, 0, 0, 0, 0, 0, 1, more, 0) + data


def container(data: bytes, packed: bool = True) -> bytes:
    body = struct.pack("<H6xL4x", 2 if packed else 0, len(data)) + (zlib.compress(data) if packed else data)
    size = 16 + len(body)
    return struct.pack("<4sHHLL", b"LOBJ", 16, 1, size, 10) + body + bytes(size % 4)


def log(folder: Path, *parts: bytes) -> BlfLog:
    data = b"".join(parts)
    header = struct.pack("<4sL8BQQLL8H8H", b"LOGG", 144, *range(8), 144 + len(data), 0, 0, 0, *DAY, *DAY)
    path = folder / "bus.blf"
    path.write_bytes(header.ljust(144, b"\0") + data)
    return BlfLog(path)


def test_units_and_versions_of_stamps(tmp_path: Path) -> None:
    objects = (obj(1, classic(), 5), obj(86, classic(), 7, TEN_MICROSECONDS), obj(1, classic(), 80_000, version=2))
    stamps = [entry.frame.stamp_ns for entry in log(tmp_path, container(b"".join(objects)))]
    assert stamps == [DAY_NS + 5, DAY_NS + 70_000, DAY_NS + 80_000]


@pytest.mark.parametrize("packed", [True, False])
def test_objects_may_be_split_over_containers(tmp_path: Path, packed: bool) -> None:
    data = b"".join(obj(1, classic(identifier=0x100 + n), n) for n in range(20))
    pieces = [container(data[at : at + 77], packed) for at in range(0, len(data), 77)]
    assert [f.frame.frame_id for f in log(tmp_path, *pieces)] == [0x100 + n for n in range(20)]
    assert len(list(log(tmp_path, obj(1, classic()), *pieces))) == 21  # one outside of any container
    entries = log(tmp_path, pieces[0], container(data, packed)[:-3])
    assert len(list(entries)) == 1
    assert entries.notes() == [
        f"{entries.path}: it ends within container 2, whose frames are lost",
        f"{entries.path}: it ends within object 2, which is left out",
    ]


@pytest.mark.parametrize("padding", [1, 7, 8, 40])
def test_padding_after_a_marker(tmp_path: Path, padding: int) -> None:
    marker = obj(96, struct.pack("<LLL3xBLLL12x", 0, 0, 0, 0, 3, 3, 0) + b"abcdef")
    objects = marker + bytes(padding) + obj(1, classic())
    result = log(tmp_path, container(objects), container(marker + bytes(padding)), container(obj(1, classic())))
    assert len(list(result)) == 2
    assert result.notes() == [f"{result.path}: left out: 2 entries that are no frames"]
    outside = log(tmp_path, marker, bytes(padding % 9), container(obj(1, classic())))
    assert len(list(outside)) == 1


def test_a_start_that_is_no_date_is_told(tmp_path: Path) -> None:
    entries = log(tmp_path, container(obj(1, classic(), 5)))
    data = entries.path.read_bytes()
    for date, notes in (
        ((2017, 13, 6, 30, 15, 6, 13, 0), [f"{entries.path}: its start is no date: times count from 1970"]),
        ((0,) * 8, []),
    ):
        entries.path.write_bytes(data.replace(struct.pack("<8H", *DAY), struct.pack("<8H", *date)))
        assert ([entry.frame.stamp_ns for entry in entries], entries.notes()) == ([5], notes)


def test_fd_64_with_all_some_and_too_few_bytes(tmp_path: Path) -> None:
    data = bytes(range(1, 13))
    objects = (
        obj(101, fd_64(9, 12, 0x7000, data)),
        obj(101, fd_64(9, 12, 0x1000, data[:5])),  # the rest is zero
        obj(101, fd_64(9, 12, 0x1000, data + b"\xff" * 8, more=32 + 40 + 12)),
        obj(101, fd_64(8, 8, 0x0000, data[:8])),
    )
    complete, short, followed, classic_one = log(tmp_path, container(b"".join(objects)))
    assert complete == LogFrame(Frame(0x1234, data, DAY_NS, True, True, True, True), "3", True)
    assert (short.frame.payload, followed.frame.payload) == (data[:5] + bytes(7), data)
    assert (classic_one.frame.is_fd, classic_one.frame.payload) == (False, data[:8])


def test_what_is_no_data_frame_is_counted(tmp_path: Path) -> None:
    """A request to send is no frame; a length code above 8 means 8 bytes."""
    fd_request = struct.pack("<HBBLLBBB5x64s", 1, 2, 8, 1, 0, 0, 1, 8, b"")
    objects = (
        *(obj(kind, classic(flags=2)) for kind in (1, 86)),
        obj(100, fd_request),
        obj(1, classic(flags=0x80)),
        obj(101, fd_64(0, 0, 0x10, b"")),
        obj(73, bytes(32)),
        obj(2, bytes(8)),
        obj(31, bytes(20)),
        obj(1, classic(flags=1, dlc=15)),
    )
    entries = log(tmp_path, container(b"".join(objects)))
    assert [(entry.is_sent, entry.frame.payload) for entry in entries] == [(True, bytes(range(8)))]
    assert (entries.remote_frames, entries.error_frames, entries.other_entries) == (2, 2, 4)


def test_stamps_before_the_start(tmp_path: Path) -> None:
    entries = log(tmp_path, container(obj(1, classic(), 2**64 - 60 * 10**9) + obj(1, classic(), 5)))
    assert [entry.frame.stamp_ns for entry in entries] == [DAY_NS - 60 * 10**9, DAY_NS + 5]
    assert entries.notes() == []


def test_what_the_recorder_says_it_lost_is_told(tmp_path: Path) -> None:
    lost = obj(125, bytes(8)) + obj(126, struct.pack("<LLQLL", 1, 0, 6, 37, 0)) + obj(91, bytes(8))
    entries = log(tmp_path, container(obj(1, classic()) + lost))
    assert len(list(entries)) == 1
    assert entries.notes() == [
        f"{entries.path}: 37 frames were lost while it was recorded",
        f"{entries.path}: its recorder had no room for all frames: some were lost",
    ]


def test_objects_that_the_heading_counts_and_that_are_not_there_are_told(tmp_path: Path) -> None:
    entries = log(tmp_path, container(obj(1, classic())))
    data = bytearray(entries.path.read_bytes())
    struct.pack_into("<L", data, 32, 3)
    entries.path.write_bytes(data)
    assert len(list(entries)) == 1
    assert entries.notes() == [f"{entries.path}: its heading counts 3 objects, 1 are in it"]


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        ((container(b"LOBX" + bytes(40)),), "object 1: no object begins where one should"),
        ((container(obj(1, classic())) + b"\1" * 40,), "container 2: is damaged"),
        ((container(obj(1, b"\0")),), "object 1: is too short for its type 1"),
        ((container(obj(1, classic(identifier=0x800))),), "object 1: 800 is no standard identifier"),
        ((container(obj(100, struct.pack("<HBBLLBBB5x64s", 1, 0, 9, 1, 0, 0, 1, 11, b""))),), "11 bytes are no"),
        ((container(obj(1, classic(), version=1)).replace(b"x\x9c", b"x\x9d", 1),), "container 1: is damaged"),
    ],
)
def test_damaged_files_are_refused(tmp_path: Path, parts: tuple[bytes, ...], said: str) -> None:
    with pytest.raises(UserError) as raised:
        list(log(tmp_path, *parts))
    assert said in str(raised.value)
