"""The format `.asc`, Vector's text log, and its writer: hexadecimal, times absolute."""

from datetime import datetime
from pathlib import Path

from observer_rt.bus.can_frame import length_code
from observer_rt.foundation.errors import UserError
from observer_rt.recording.canlog.asc.date import MONTHS
from observer_rt.recording.canlog.asc.reader import (
    FLAG_BIT_RATE_SWITCH,
    FLAG_ERROR_STATE,
    FLAG_FD,
    AscLog,
)
from observer_rt.recording.canlog.can_log import NANOSECONDS, ChannelNumbers, LogFrame, LogWriter
from observer_rt.recording.canlog.log_format import LogFormat

DAYS = ("Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun")


class AscWriter(LogWriter):
    """Writer; channels are numbered from 1. Stamps have six digits where those are enough, else nine."""

    def __init__(self, path: Path, start_ns: int) -> None:
        """See `LogWriter`."""
        super().__init__(path, start_ns)
        millisecond = NANOSECONDS // 1000
        self._start = start_ns // millisecond * millisecond
        self._numbers = ChannelNumbers()
        moment = datetime.fromtimestamp(self._start // NANOSECONDS)
        date = (
            f"{DAYS[moment.weekday()]} {MONTHS[moment.month - 1]} {moment.day:02d} {moment:%H:%M:%S}."
            f"{self._start % NANOSECONDS // millisecond:03d} {moment.year}"
        )
        self._file = path.open("w", encoding="ascii", newline="\n")
        self._file.write(
            f"date {date}\nbase hex  timestamps absolute\ninternal events logged\n"
            f"Begin Triggerblock {date}\n   0.000000 Start of measurement\n"
        )

    def write(self, entry: LogFrame) -> None:
        frame = entry.frame
        time = frame.stamp_ns - self._start
        if time < 0:
            raise UserError(str(self.path), "a frame is older than the first ones", "split the log there")
        seconds, rest = divmod(time, NANOSECONDS)
        stamp = f"{seconds:4d}.{rest:09d}" if rest % 1000 else f"{seconds:4d}.{rest // 1000:06d}"
        channel = self._numbers.of(entry.channel)
        identifier = f"{frame.frame_id:X}{'x' if frame.is_extended else ''}"
        direction = "Tx" if entry.is_sent else "Rx"
        data = frame.payload.hex(" ").upper()
        length = len(frame.payload)
        if frame.is_fd:
            flags = FLAG_FD | FLAG_BIT_RATE_SWITCH * frame.bit_rate_switch
            flags |= FLAG_ERROR_STATE * frame.error_state_indicator
            self._file.write(
                f"{stamp} CANFD {channel:>3} {direction:<4} {identifier:>8}  {'':>32} "
                f"{frame.bit_rate_switch:d} {frame.error_state_indicator:d} {length_code(length):x} "
                f"{length:>2} {data} {0:>8} {0:>4} {flags:>8X} {0:>8} {0:>8} {0:>8} {0:>8} {0:>8}\n"
            )
        else:
            self._file.write(
                f"{stamp} {channel}  {identifier:<15} {direction:<4} d {length:x} {data}".rstrip() + "\n"
            )

    def close(self) -> None:
        if not self._file.closed:
            self._file.write("End TriggerBlock\n")
            self._file.close()


ASC = LogFormat((".asc",), "Vector, text", AscLog, AscWriter, is_text=True)
