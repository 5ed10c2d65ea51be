"""Logs that python-can writes, and those of text that it reads, line by line: nothing it passes over is lost."""

from abc import abstractmethod
from collections.abc import Iterator
from pathlib import Path
from typing import ClassVar

import can
from can.io.generic import TextIOMessageReader

from observer_rt.bus.can_frame import CLASSIC_LENGTH
from observer_rt.bus.links.link import Frame
from observer_rt.files.canlog.can_log import NANOSECONDS, LogFormat, LogFrame, LogWriter
from observer_rt.files.canlog.text_log import EARLIEST_DATE, TextLogReader, head_of, likeness
from observer_rt.foundation.errors import UserError

MICROSECOND, MILLISECOND = 1000, 1_000_000  # ns
_CSV_HEADING = "timestamp,arbitration_id,extended,remote,error,dlc,data"


class PythonCanLog(TextLogReader):
    """Reader by one of python-can's; channels are named by their number."""

    reader: ClassVar[type[TextIOMessageReader]]

    def _entries(self) -> Iterator[tuple[int, LogFrame]]:
        self._number, self._text, self._is_open = 0, "", False
        messages = iter(self.reader(self._handed()))  # type: ignore[arg-type]  # it iterates and closes it
        while True:
            entry = None
            try:
                message = next(messages, None)
                if message is None:
                    break
                self._is_open = False
                if message.is_error_frame:
                    self.error_frames += 1
                elif self._is_remote(message):
                    self.remote_frames += 1
                else:
                    entry = self._frame(message)
            except (ValueError, LookupError, ArithmeticError):
                self.refuse_line(self._number, self._text)
            if entry is not None:
                yield self._number, entry
        self._end()

    def _handed(self) -> Iterator[str]:
        """The lines for python-can, each once it is known what became of the one before."""
        for number, text in self._lines():
            self._number, self._text = number, text
            heading, line = self._prepared(text)
            yield from heading
            if line:
                self._is_open = True
                yield line
                if self._is_open:
                    self._pass_over(text.split())

    def _end(self) -> None:
        """Note what shows only when all is read."""

    def _is_remote(self, message: can.Message) -> bool:
        return message.is_remote_frame

    @abstractmethod
    def _prepared(self, text: str) -> tuple[list[str], str]:
        """What python-can is to read of a line: of the heading, and what may hold a frame. Raises `ValueError`."""

    @abstractmethod
    def _pass_over(self, words: list[str]) -> None:
        """Count a line that gave no frame. Raises `ValueError` unless such a line never holds one."""

    @abstractmethod
    def _frame(self, message: can.Message) -> LogFrame | None:
        """The data frame of the last line; None: none that was on a bus. Raises `ValueError` where malformed."""


def log_frame(message: can.Message, stamp: int, is_fd: bool, channel: object) -> LogFrame:
    frame = Frame(
        message.arbitration_id,
        bytes(message.data),
        stamp,
        message.is_extended_id,
        is_fd,
        message.bitrate_switch,
        message.error_state_indicator,
    )
    return LogFrame(frame, str(channel), not message.is_rx)


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


class CsvLog(PythonCanLog):
    """Reader of python-can's own text, which has no channels."""

    kind = "a CSV log"
    reader = can.CSVReader

    def _prepared(self, text: str) -> tuple[list[str], str]:
        if self._number > 1:
            return [], text
        if text != _CSV_HEADING:
            self.refuse_content(1, "no log of python-can", "give a log as .log, .blf, .asc or .trc")
        return [text], ""

    def _pass_over(self, words: list[str]) -> None:
        raise ValueError

    def _frame(self, message: can.Message) -> LogFrame | None:
        if len(message.data) != message.dlc:
            raise ValueError
        stamp = round(message.timestamp * NANOSECONDS)
        if stamp < EARLIEST_DATE:
            self.remark("its times are taken to count from its start")
        return log_frame(message, stamp, message.dlc > CLASSIC_LENGTH, 1)


def is_csv_log(path: Path) -> bool:
    """Whether a file is python-can's, or another log of frames, which its reader refuses by name."""
    head = head_of(path) if path.is_file() else b""
    return head.startswith(_CSV_HEADING.encode()) or bool(likeness(path)[0] if head else "")


CSV_LOG = LogFormat(".csv", CsvLog, recognises=is_csv_log)
