"""Logs that python-can writes; that of `.blf` may be read while it is written."""

import os
from pathlib import Path

import can

from observer_rt.files.canlog.can_log import NANOSECONDS, LogFrame, LogRecorder, LogWriter, lost_note
from observer_rt.foundation.errors import UserError

MICROSECOND, MILLISECOND = 1000, 1_000_000  # ns
OLDEST_START = 631_152_000 * NANOSECONDS  # 1990: an earlier time is no date in BLF, and is counted from 0
FASTEST_PACKING = 1  # of zlib: a fifth larger than its default, three times faster


class PythonCanWriter(LogWriter):
    """Writer by one of python-can's: stamps are float seconds there, off by less than 1 us. Channels count from 1."""

    _writer: can.BLFWriter | can.ASCWriter | can.TRCWriter

    def write(self, entry: LogFrame) -> None:
        frame = entry.frame
        if frame.stamp_ns < self._start:
            raise UserError(str(self.path), "a frame is older than the first ones", "split the log there")
        self._writer.on_message_received(
            can.Message(
                timestamp=frame.stamp_ns / NANOSECONDS,
                arbitration_id=frame.frame_id,
                is_extended_id=frame.is_extended,
                data=frame.payload,
                is_fd=frame.is_fd,
                bitrate_switch=frame.bit_rate_switch,
                error_state_indicator=frame.error_state_indicator,
                is_rx=not entry.is_sent,
                channel=self._numbers.of(entry.channel) - 1,
            )
        )

    def close(self) -> None:
        if not self._writer.file.closed:
            self._writer.stop()


class _FlushedBlf(can.BLFWriter):
    """python-can's writer, whose file can also be completed while it goes on."""

    def flush(self) -> None:
        """Write what was kept for the next container, and how much there is."""
        self._flush()
        end = self.file.seek(0, os.SEEK_END)
        self.file.seek(0)
        self._write_header(end)
        self.file.seek(end)
        self.file.flush()
        os.fsync(self.file.fileno())


class BlfWriter(PythonCanWriter, LogRecorder):
    """Writer of Vector's binary logs."""

    start_step = MILLISECOND

    def __init__(self, path: Path, start_ns: int) -> None:
        """See `LogWriter`."""
        super().__init__(path, start_ns if start_ns >= OLDEST_START else 0)
        self._writer: _FlushedBlf = _FlushedBlf(path, compression_level=FASTEST_PACKING)
        self._writer.start_timestamp = self._writer.stop_timestamp = self._start / NANOSECONDS

    def write_lost(self, frames: int) -> None:
        self._writer.log_event(lost_note(frames))

    def flush(self) -> None:
        self._writer.flush()
