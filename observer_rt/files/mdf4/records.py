"""Number of records in an MDF4 file: its data walked through from record to record.

asammdf, which reads them, stops at the first record that it cannot follow, without an error: one bit, and half of a
log is gone.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.files.mdf4_records import LENGTH_SIZE, UNKNOWN_ID, VARIABLE, numbers_at, walk
from observer_rt.files.checksum import refuse_damaged
from observer_rt.files.mdf4.blocks import (
    ALIGNMENT,
    DAMAGE,
    READABLE,
    Blocks,
    ChannelGroup,
    CountedRecords,
    DataGroup,
    DataReference,
    GroupCount,
    refuse_other_files,
)
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_errors

ID_SIZES = (0, 1, 2, 4, 8)
LONGEST_EXPECTED = 64  # bytes of variable length that a frame has at the most
RECORDS_AT_ONCE = 1 << 18
UNFINISHED_LIST = "its list of data was not finished: whether records are missing cannot be seen"


def count_records(path: Path) -> CountedRecords:
    """Raises `UserError` for a file that is none of MDF 4 or damaged: by its checksum, or where no record follows."""
    with file_errors(path):
        refuse_other_files(path)
        odd = refuse_damaged(path)
        try:
            with path.open("rb") as file:
                blocks = Blocks(file, path.stat().st_size)
                if not blocks.has_lists:
                    return CountedRecords({}, (*odd, UNFINISHED_LIST))
                groups: dict[int, GroupCount] = {}
                remarks = list(odd)
                for group in blocks.data_groups():
                    has_references = [bool(each.references) for each in group.channel_groups] == [True]
                    if group.id_size or (has_references and not blocks.is_open):
                        walked = _Walk(blocks, group)
                        walked.run()
                        counts, said = walked.counts(), walked.remarks
                    else:
                        counts, said = _of_one(blocks, group)
                    groups |= {  # of which more is known than the heading states
                        place: count
                        for place, count in counts.items()
                        if not (count.found == count.complete == (count.stated or 0))
                    }
                    remarks += said
                return CountedRecords(groups, tuple(remarks))
        except DAMAGE as error:
            remedy = error.remedy if isinstance(error, _RecordError) else READABLE
            raise UserError(str(path), f"a damaged MDF file: {error}", remedy) from None


class _RecordError(ValueError):
    """Place where no record can follow. byte: of the file, if what stands before it can be read alone."""

    def __init__(self, problem: str, byte: int | None) -> None:
        super().__init__(problem)
        self.remedy = READABLE
        if byte is not None:
            self.remedy += f", or what stands before that byte: head -c {byte} FILE > BEGINNING.mf4"


def _of_one(blocks: Blocks, group: DataGroup) -> tuple[dict[int, GroupCount], list[str]]:
    """Records without ids, of one kind: as many as fit."""
    if not group.channel_groups:
        return {}, []
    if len(group.channel_groups) > 1 and group.size:
        raise ValueError("records of several groups stand together without ids")
    each = group.channel_groups[0]
    found, rest = divmod(group.size, each.length) if each.length else (each.stated, 0)
    remarks = ["its last record is cut short and left out"] if rest and blocks.is_open else []
    return {each.place: GroupCount(found, found, each.stated if blocks.has_cycles else None)}, remarks


class _Walk:
    """Goes from record to record through the data of a group, and through those of variable length apart from it."""

    def __init__(self, blocks: Blocks, group: DataGroup) -> None:
        if group.id_size not in ID_SIZES:
            raise ValueError(f"{group.id_size} bytes are no size of a record id")
        self._blocks, self._group = blocks, group
        self._kinds = sorted(group.channel_groups, key=lambda each: each.record_id)
        self._ids = np.array([each.record_id if group.id_size else 0 for each in self._kinds], np.uint64)
        if np.unique(self._ids).size < self._ids.size:
            raise ValueError("two channel groups have the same record id")
        lengths = (VARIABLE if each.length is None else each.length for each in self._kinds)
        self._lengths = np.fromiter(lengths, np.int64)
        self._found = np.zeros(self._ids.size, np.int64)
        self._fields = [_Field(each, reference) for each in self._kinds for reference in each.references]
        self._variable = {each.place: _VariableData() for each in self._kinds if each.length is None}
        for place in {each.reference.target for each in self._fields} - self._variable.keys():
            records = ChannelGroup(place, 0, None, 0)  # of variable length, in blocks of their own
            walk = _Walk(self._blocks, DataGroup(0, (records,), self._blocks.pieces(place)))
            walk.run()
            self._variable[place] = walk._variable[place]
        self._kind_of = np.empty(RECORDS_AT_ONCE, np.int64)
        self._place_of = np.empty(RECORDS_AT_ONCE, np.int64)
        self.remarks: list[str] = []

    def run(self) -> None:
        """Walk. Raises `ValueError` where no record can follow, `_RecordError` where that has a place."""
        done, held, needed = 0, 0, 0
        waiting: list[NDArray[np.uint8]] = []
        for part in self._blocks.contents(self._group):
            waiting.append(part)
            held += part.size
            if held < needed:
                continue
            data = waiting[0] if len(waiting) == 1 else np.concatenate(waiting)
            position = needed = 0
            while not needed:
                count, position, needed = walk(
                    data,
                    position,
                    self._group.id_size,
                    self._ids,
                    self._lengths,
                    self._kind_of,
                    self._place_of,
                )
                self._note(data, self._kind_of[:count], self._place_of[:count])
            done += position
            waiting, held = [data[position:]], data.size - position
            if needed == UNKNOWN_ID or needed > self._group.size - done:
                break
        if done < self._group.size and (self._group.id_size or self._lengths.max() == VARIABLE):
            self._end(done, needed)

    def counts(self) -> dict[int, GroupCount]:
        """Counts of the records found, by group."""
        complete = dict(zip((each.place for each in self._kinds), self._found.tolist(), strict=True))
        for each in self._fields if self._blocks.has_offsets else ():
            place = each.group.place
            complete[place] = min(complete[place], self._with_data(each))
        unused = sum(each.unused for each in self._variable.values()) if self._blocks.has_offsets else 0
        if unused:
            self.remarks.append(f"{unused} data of variable length belong to no record: it may be damaged")
        return {
            each.place: GroupCount(
                found, complete[each.place], each.stated if self._blocks.has_cycles else None
            )
            for each, found in zip(self._kinds, self._found.tolist(), strict=True)
        }

    def _note(self, data: NDArray[np.uint8], kind_of: NDArray[np.int64], place_of: NDArray[np.int64]) -> None:
        self._found += np.bincount(kind_of, minlength=self._found.size)
        for number, kind in enumerate(self._kinds):
            if kind.place in self._variable:
                places = place_of[kind_of == number]
                self._variable[kind.place].take(numbers_at(data, places, LENGTH_SIZE))
        for each in self._fields:
            places = place_of[kind_of == self._kinds.index(each.group)]
            each.offsets.append(numbers_at(data, places + each.reference.byte, each.reference.size))

    def _end(self, done: int, needed: int) -> None:
        """Judge what is left of the data: filled up, cut short, or damaged."""
        rest = self._group.size - done
        if self._is_blank(done):
            if rest >= ALIGNMENT:
                self.remarks.append(f"its last {rest} bytes are blank: its end may be missing")
            return
        name, byte = self._place(done)
        if needed == UNKNOWN_ID:
            raise _RecordError(f"no record has the id that stands at {name}", byte)
        longest = max((each.longest for each in self._variable.values()), default=0)
        expected = max(int(self._lengths.max()), LENGTH_SIZE + max(longest, LONGEST_EXPECTED))
        if not self._blocks.is_open or needed > self._group.id_size + expected:
            raise _RecordError(f"the record at {name} ends {needed - rest} bytes beyond the data", byte)
        self.remarks.append("its last record is cut short and left out")

    def _is_blank(self, done: int) -> bool:
        """Whether there are zeros only from a place on."""
        first = 0
        for part in self._blocks.contents(self._group):
            if part[max(0, done - first) :].any():
                return False
            first += part.size
        return True

    def _place(self, position: int) -> tuple[str, int | None]:
        """A place in the data as it is found in the file; the byte, if the file may end there."""
        for piece in self._group.pieces:
            if position < piece.size:
                break
            position -= piece.size
        if piece.packing is not None:
            return f"byte {position} of the data packed at byte {piece.place}", None
        byte = piece.place + position
        return f"byte {byte}", byte if self._blocks.is_open else None

    def _with_data(self, led: "_Field") -> int:
        """Number of records that lead to data that are there; the last ones may not where a file was cut."""
        data = self._variable[led.reference.target]
        offsets = np.concatenate(led.offsets) if led.offsets else np.empty(0, np.uint64)
        lost = np.flatnonzero(~data.use(offsets))
        if not lost.size:
            return offsets.size
        first = int(lost[0])
        later = offsets[first:]
        if self._blocks.is_open and np.all(later >= data.end):
            self.remarks.append(
                f"its last {later.size} records have no data and are left out: its end is missing"
            )
            return first
        if np.all(later == data.end):  # nothing is stored for what is empty
            return offsets.size
        raise ValueError(f"record {first + 1} of id {led.group.record_id} leads to where no data begin")


@dataclass
class _Field:
    """A reference of the records of a group, and where each of them leads."""

    group: ChannelGroup
    reference: DataReference
    offsets: list[NDArray[np.uint64]] = field(default_factory=list)

    def __post_init__(self) -> None:
        if self.reference.byte + self.reference.size > (self.group.length or 0):
            raise ValueError("a field reaches beyond its record")


class _VariableData:
    """Places where data of variable length begin that are led to, counted as references count: with their lengths."""

    def __init__(self) -> None:
        self.end = 0
        self.longest = 0
        self._starts: list[NDArray[np.uint64]] = []
        self._used: NDArray[np.bool_] | None = None

    def take(self, lengths: NDArray[np.uint64]) -> None:
        """Go on with further ones."""
        if not lengths.size:
            return
        ends = self.end + np.cumsum(lengths + np.uint64(LENGTH_SIZE), dtype=np.uint64)
        self._starts.append(np.concatenate(([np.uint64(self.end)], ends[:-1])))
        self.end = int(ends[-1])
        self.longest = max(self.longest, int(lengths.max()))

    def use(self, offsets: NDArray[np.uint64]) -> NDArray[np.bool_]:
        """Mark which references lead to where data begin, True or False, and count these data as used."""
        starts = np.concatenate(self._starts) if self._starts else np.empty(0, np.uint64)
        if self._used is None:
            self._used = np.zeros(starts.size, np.bool_)
        places = np.searchsorted(starts, offsets)
        there = places < starts.size
        there[there] = starts[places[there]] == offsets[there]
        self._used[places[there]] = True
        return there

    @property
    def unused(self) -> int:
        """Number of data that nothing led to."""
        return 0 if self._used is None else int(self._used.size - np.count_nonzero(self._used))
