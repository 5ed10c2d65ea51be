"""Blocks of MDF4 files, as far as they state place, length and number of records.

asammdf reads what is in the records, in a process of its own, for it trusts what stands in a file. What leads to them
is read here, too, for asammdf passes over records that it cannot follow. Every link is followed once, every length is
compared with the file: damage raises one of `DAMAGE`.
"""

import struct
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_errors
from observer_rt.foundation.sandbox import WorkerError, run_apart

READABLE = "give a complete MDF 4 measurement"

MAGICS = (b"MDF     ", b"UnFinMF ")  # complete, and as a logger leaves it
MAJOR_VERSION = b"4."
ALIGNMENT = 8  # bytes to which blocks are filled up
DAMAGE = (ValueError, LookupError, struct.error)
_FLAGS_PLACE = 60  # of the steps that finalise the file
_UPDATE_CYCLES, _UPDATE_LAST_LENGTH, _UPDATE_LAST_LIST, _UPDATE_OFFSETS = 0x1, 0x4, 0x10, 0x40
_HEADER_PLACE = 64
_HEAD = struct.Struct("<4s4xQQ")  # of a block: kind, length with this head, number of links
_CHANNEL_GROUP = struct.Struct("<QQH6xII")  # record id, cycles, flags, bytes of data and of invalidation bits
_CHANNEL = struct.Struct("<BxxBII")  # kind, bit, byte, number of bits
_PACKED = struct.Struct("<2xBxIQQ")  # packing, bytes of a row, size unpacked, size packed
_LIST_DATA = struct.Struct("<4xI")  # number of blocks
_LONGEST_CONTENT = max(each.size for each in (_CHANNEL_GROUP, _CHANNEL, _PACKED))
_VARIABLE_GROUP, _VARIABLE_CHANNEL = 0x1, 1
_CHANNELS, _ARRAY = b"##CN", b"##CA"
_SIGNAL_DATA = (b"##SD", b"##DZ", b"##DL", b"##HL")
_DEFLATED, _TRANSPOSED = 0, 1
MOST_DEFLATED = 1100  # bytes that one can stand for
_AT_ONCE = 1 << 25  # bytes


def mdf4_apart(module: str, function: str, path: Path, *arguments: Any) -> Iterator[Any]:
    """Call `run_apart`; a reader that crashes is damage of the file. Raises `UserError` naming the file."""
    with crash_told(path), file_errors(path):
        yield from run_apart(module, function, path, *arguments)


@contextmanager
def crash_told(path: Path) -> Iterator[None]:
    """Turn `WorkerError` of a reader, or of what is made of its answers, into `UserError`."""
    try:
        yield
    except WorkerError as error:
        raise UserError(str(path), f"a damaged MDF file: {error}", READABLE) from None


@dataclass(frozen=True)
class DataReference:
    """A field of a record that holds where its data begin, among those of the group, or in the blocks, at a place."""

    byte: int
    size: int
    target: int


@dataclass(frozen=True)
class ChannelGroup:
    """Records of one kind. length: in bytes, without the id; None: each states its own."""

    place: int
    record_id: int
    length: int | None
    stated: int
    references: tuple[DataReference, ...] = ()


@dataclass(frozen=True)
class Piece:
    """Data in one block. packing: None for plain data; row: bytes of one, where rows and columns are exchanged."""

    place: int
    size: int
    packing: int | None = None
    stored: int = 0
    row: int = 0


@dataclass(frozen=True)
class DataGroup:
    """Records of one kind, or of several with an id of so many bytes before each, in pieces that end anywhere."""

    id_size: int
    channel_groups: tuple[ChannelGroup, ...]
    pieces: tuple[Piece, ...]

    @property
    def size(self) -> int:
        """Bytes of data."""
        return sum(piece.size for piece in self.pieces)


class GroupCount(NamedTuple):
    """Records of a channel group in the data, and those of them that are complete. stated: by its heading; None:
    it does not."""

    found: int
    complete: int
    stated: int | None

    def readable(self, cycles: int) -> int:
        """Number of `cycles` of asammdf that can be read. Raises `ValueError` where it lost some."""
        if self.stated is None and cycles != self.found:
            raise ValueError(f"only {cycles} of {self.found} records can be put in order")
        return min(cycles, self.complete)


@dataclass(frozen=True)
class CountedRecords:
    """Records of a file, and what is odd about them. groups: by place, those that are not as stated, for it is sent
    from process to process, as JSON."""

    groups: Mapping[int, GroupCount]
    remarks: tuple[str, ...]

    @property
    def as_json(self) -> str:
        """Text for another process."""
        return TypeAdapter(CountedRecords).dump_json(self).decode()

    @classmethod
    def of_json(cls, text: str) -> Self:
        """From the text."""
        return TypeAdapter(cls).validate_json(text)

    def readable(self, place: int, cycles: int) -> int:
        """Number of cycles that can be read of the group at a place, as of its `GroupCount`."""
        return self.groups[place].readable(cycles) if place in self.groups else cycles

    def contradictions(self, places: Iterable[int], noun: str) -> tuple[str, ...]:
        """Contradictions between headings of some channel groups and the data, in sentences about `noun`."""
        counts = [self.groups[place] for place in places if place in self.groups]
        stated = [(count.found, count.stated) for count in counts if count.stated is not None]
        uncounted = sum(max(0, found - said) for found, said in stated)
        missing = sum(max(0, said - found) for found, said in stated)
        sentences = (
            (uncounted, f"its heading leaves out {uncounted} {noun} that are in it: it may be damaged"),
            (missing, f"its heading counts {missing} {noun} that are not in it: its end may be missing"),
        )
        return tuple(sentence for count, sentence in sentences if count)


@dataclass(frozen=True)
class _Block:
    kind: bytes
    place: int
    length: int
    links: tuple[int, ...]
    content: bytes


def refuse_other_files(path: Path) -> None:
    """Raise `UserError` for what is not MDF of version 4."""
    with path.open("rb") as file:
        mark, version = file.read(len(MAGICS[0])), file.read(len(MAJOR_VERSION))
    if mark not in MAGICS:
        raise UserError(str(path), "not an MDF file", READABLE)
    if version != MAJOR_VERSION:
        raise UserError(str(path), f"is of MDF {version.decode('ascii', 'replace')}, not 4", READABLE)


class Blocks:
    """An open file. Raises one of `DAMAGE`."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._file = file
        self._size = size
        self._seen: set[int] = set()
        self._linked: set[int] = set()
        (flags,) = struct.unpack("<H", self._read(_FLAGS_PLACE, 2))
        self.has_cycles = not flags & _UPDATE_CYCLES
        """Whether the headings state the number of records."""
        self.has_offsets = not flags & _UPDATE_OFFSETS
        """Whether references to data of variable length are right."""
        self.has_lists = not flags & _UPDATE_LAST_LIST
        """Whether lists of data are complete."""
        self.is_open = bool(flags & _UPDATE_LAST_LENGTH)
        """Whether the last data go on to the end of the file: a logger writes them, or was stopped."""

    def data_groups(self) -> list[DataGroup]:
        """Data groups of the file, with an open last piece up to its end."""
        groups = []
        place = self._block(_HEADER_PLACE, b"##HD").links[0]
        while place:
            block = self._block(place, b"##DG")
            place, first, data, _ = block.links[:4]
            in_columns = data > 0 and self._read(data, 4) in (b"##DV", b"##LD")
            channel_groups = tuple(self._channel_groups(first, in_columns))
            pieces = self.pieces(data) if data else ()
            groups.append(DataGroup(block.content[0], channel_groups, pieces))
        if self.is_open:
            groups = self._to_the_end(groups)
        for piece in (piece for group in groups for piece in group.pieces):
            if piece.place + (piece.size if piece.packing is None else piece.stored) > self._size:
                raise ValueError(f"the data at byte {piece.place} reach beyond the end of the file")
        return groups

    def contents(self, group: DataGroup) -> Iterator[NDArray[np.uint8]]:
        """The data of a group, unpacked, a part after the other."""
        for piece in group.pieces:
            if piece.packing is not None:
                yield self._unpacked(piece)
                continue
            for first in range(0, piece.size, _AT_ONCE):
                part = self._read(piece.place + first, min(_AT_ONCE, piece.size - first))
                yield np.frombuffer(part, np.uint8)

    def _read(self, place: int, size: int) -> bytes:
        if place + size > self._size:
            raise ValueError(f"the block at byte {place} reaches beyond the end of the file")
        self._file.seek(place)
        return self._file.read(size)

    def _block(self, place: int, *kinds: bytes) -> _Block:
        """A block of one of some kinds, or of any, met for the first time."""
        if place in self._seen:
            raise ValueError(f"its links lead to byte {place} again")
        self._seen.add(place)
        kind, length, count = _HEAD.unpack(self._read(place, _HEAD.size))
        if kinds and kind not in kinds:
            raise ValueError(f"no block {kinds[0].decode()} at byte {place}")
        begin = _HEAD.size + 8 * count
        if length < begin:
            raise ValueError(f"the block at byte {place} is shorter than its links")
        links = struct.unpack(f"<{count}Q", self._read(place + _HEAD.size, 8 * count))
        content = self._read(place + begin, min(length - begin, _LONGEST_CONTENT, self._size - place - begin))
        self._linked.update(links)
        return _Block(kind, place, length, links, content)

    def _channel_groups(self, place: int, in_columns: bool) -> list[ChannelGroup]:
        """The groups from a place on, with the references that lead to data.

        in_columns: records without their invalidation bits, which stand apart.
        """
        found = []
        first_channels = []
        while place:
            block = self._block(place, b"##CG")
            record_id, cycles, flags, data, invalidation = _CHANNEL_GROUP.unpack_from(block.content)
            length = None if flags & _VARIABLE_GROUP else data + invalidation * (not in_columns)
            found.append(ChannelGroup(place, record_id, length, cycles))
            first_channels.append(block.links[1])
            place = block.links[0]
        places = {group.place for group in found if group.length is None}
        return [
            replace(
                group,
                references=tuple(
                    each
                    for each in self._references(first)
                    if each.target in places or (each.target and self._read(each.target, 4) in _SIGNAL_DATA)
                ),
            )
            for group, first in zip(found, first_channels, strict=True)
        ]

    def _references(self, place: int) -> Iterator[DataReference]:
        """References to data of variable length, of the channels from a place on and those they are made of."""
        waiting = [place]
        while waiting:
            place = waiting.pop()
            if not place or place in self._seen:
                continue
            block = self._block(place)
            if block.kind == _ARRAY:
                waiting.append(block.links[0])
            if block.kind != _CHANNELS:
                continue
            kind, bit, byte, bits = _CHANNEL.unpack_from(block.content)
            if kind == _VARIABLE_CHANNEL and bit == 0 and bits in (8, 16, 32, 64):
                yield DataReference(byte, bits // 8, block.links[5])
            waiting += block.links[:2]

    def pieces(self, place: int) -> tuple[Piece, ...]:
        """Pieces of the data at a place, be it a block or a list of them."""
        return tuple(self._pieces(place))

    def _pieces(self, place: int) -> Iterator[Piece]:
        block = self._block(place, b"##DT", b"##DV", b"##SD", b"##DZ", b"##DL", b"##LD", b"##HL")
        if block.kind == b"##HL":
            block = self._block(block.links[0], b"##DL")
        if block.kind not in (b"##DL", b"##LD"):
            yield self._piece(block)
            return
        while True:
            links = block.links[1:]
            if block.kind == b"##LD":  # invalidation bits follow
                links = links[: _LIST_DATA.unpack_from(block.content)[0]]
            for link in filter(None, links):
                yield self._piece(self._block(link, b"##DT", b"##DV", b"##SD", b"##DZ"))
            if not block.links[0]:
                return
            block = self._block(block.links[0], block.kind)

    def _piece(self, block: _Block) -> Piece:
        if block.kind == b"##DZ":
            packing, row, size, stored = _PACKED.unpack_from(block.content)
            return Piece(block.place + _HEAD.size + _PACKED.size, size, packing, stored, row)
        return Piece(block.place + _HEAD.size, block.length - _HEAD.size)

    def _to_the_end(self, groups: list[DataGroup]) -> list[DataGroup]:
        """The data groups with the last piece of all as long as its place allows: its length was not written yet."""
        last = max(
            (piece for group in groups for piece in group.pieces), key=lambda each: each.place, default=None
        )
        if (
            last is None
            or last.packing is not None
            or (last.size and self._begins_block(last.place + last.size))
        ):
            return groups
        following = (
            place for place in sorted(self._linked) if place > last.place and self._begins_block(place)
        )
        ended = replace(last, size=next(following, self._size) - last.place)
        return [
            replace(group, pieces=tuple(ended if piece is last else piece for piece in group.pieces))
            for group in groups
        ]

    def _begins_block(self, place: int) -> bool:
        place += -place % ALIGNMENT
        return place + _HEAD.size <= self._size and self._read(place, 2) == b"##"

    def _unpacked(self, piece: Piece) -> NDArray[np.uint8]:
        if piece.packing not in (_DEFLATED, _TRANSPOSED):
            raise ValueError(
                f"the data at byte {piece.place} are packed in a way unknown here ({piece.packing})"
            )
        if piece.size > MOST_DEFLATED * (piece.stored + 1):
            raise ValueError(f"the data at byte {piece.place} cannot be {piece.size} bytes when unpacked")
        unpacker = zlib.decompressobj()
        try:
            data = unpacker.decompress(self._read(piece.place, piece.stored), piece.size + 1)
        except zlib.error as error:
            raise ValueError(f"the data at byte {piece.place} cannot be unpacked: {error}") from None
        if len(data) != piece.size or not unpacker.eof:
            raise ValueError(f"the data at byte {piece.place} are not {piece.size} bytes when unpacked")
        array = np.frombuffer(data, np.uint8)
        if piece.packing == _TRANSPOSED and piece.row:
            whole = piece.size // piece.row * piece.row
            rows = array[:whole].reshape(piece.row, -1).T.ravel()
            array = np.concatenate((rows, array[whole:]))
        return array
