"""Reader of CAN frames in MDF4 files; what touches the file runs apart (`mdf4_records.py`)."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from observer_rt.recording.canlog.can_log import LogFrame, LogReader
from observer_rt.recording.mdf4_apart import mdf4_apart
from observer_rt.recording.mdf4_records import count_records

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

RECORDS = "observer_rt.recording.canlog.mdf4.records"


def is_bus_log(path: Path) -> bool:
    """Whether an MDF4 file is a log of a bus. Raises `UserError` for a file that is damaged or none of MDF."""
    return any(mdf4_apart(RECORDS, "is_log", path))


class Mdf4Log(LogReader):
    """Reader; channels are named by their number. Frames of several groups are put in order of time."""

    unit = "frame"

    def _entries(self) -> Iterator[tuple[int, LogFrame]]:
        parts = mdf4_apart(RECORDS, "records", self.path, count_records(self.path))
        self._size, self.error_frames, self.remote_frames, self.other_entries, remarks = next(parts)
        self.remarks += remarks
        if not self._size:
            self.remarks.append(
                "it is a CAN log without a data frame: nothing was recorded, or it is damaged"
            )
        for records in parts:
            for record in _frames(records):
                self._position += 1
                yield self._position, self.frame(self._position, *record)


def _frames(
    records: "NDArray[np.void]",
) -> Iterator[tuple[int, int, bool, bytes, bool, str, bool, bool, bool]]:
    """The arguments of `LogReader.frame` for each record."""
    data = records["data"].tobytes()
    width = records["data"].shape[1]
    starts = range(0, width * records.size, width)
    payloads = (
        data[start : start + size] for start, size in zip(starts, records["length"].tolist(), strict=True)
    )
    columns = (
        records[name].tolist() for name in ("is_fd", "channel", "bit_rate_switch", "error_state", "is_sent")
    )
    return zip(
        records["stamp"].tolist(),
        records["id"].tolist(),
        records["is_extended"].tolist(),
        payloads,
        *columns,
        strict=True,
    )
