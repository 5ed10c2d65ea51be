"""What `candump` prints on the screen with time stamps: `(1700000000.000123)  can0  123   [2]  AA BB`."""

import re
from dataclasses import dataclass
from datetime import datetime

from observer_rt.recording.canlog.can_log import NANOSECONDS, text_nanoseconds

EARLIEST_DATE = (
    100_000_000  # s since 1970: what is less counts from the start of the log, or from line to line
)
TWO_DIGITS = 2  # of a length, which only CAN FD frames have
ERROR_FRAME = 0x2000_0000  # CAN_ERR_FLAG in the identifier of an error frame

_LINE = re.compile(
    r"(?:\((?P<stamp>\d+\.\d{6,9}|\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d{6,9})\)\s+)?(?P<channel>[^\s\ufffd]+)\s+"
    r"(?:(?P<direction>TX|RX) (?P<switch>[B-]) (?P<state>[E-])\s+)?"
    r"(?P<id>[0-9A-F]{3}|[0-9A-F]{8})\s+\[(?P<length>\d{1,2})\]"
    r"(?:\s+(?P<remote>remote request)|(?P<data>(?:\s+[0-9A-F]{2})*)(?:\s+(?:'.*'|ERRORFRAME))?)"
)


@dataclass(frozen=True)
class ScreenLine:
    """One line; `stamp_ns` is None where it has no time, and counts from 1970 only if `is_dated`."""

    stamp_ns: int | None
    is_dated: bool
    channel: str
    identifier: int
    is_extended: bool
    payload: bytes
    is_fd: bool
    bit_rate_switch: bool
    error_state: bool
    is_sent: bool
    is_remote: bool
    is_error: bool


def screen_line(text: str) -> ScreenLine | None:
    """What a line of the screen says, None for another text. Raises `ValueError` for data that are not its length."""
    match = _LINE.fullmatch(text)
    if match is None:
        return None
    stamp = None if match["stamp"] is None else _stamp(match["stamp"])
    payload = bytes.fromhex(match["data"] or "")
    identifier = int(match["id"], 16)
    is_extended = len(match["id"]) == len("12345678")
    is_remote = match["remote"] is not None
    if len(payload) != int(match["length"]) and not is_remote:
        raise ValueError(f"{len(payload)} bytes follow the length {match['length']}")
    return ScreenLine(
        stamp_ns=stamp,
        is_dated=stamp is not None and stamp >= EARLIEST_DATE * NANOSECONDS,
        channel=match["channel"],
        identifier=identifier,
        is_extended=is_extended,
        payload=payload,
        is_fd=len(match["length"]) == TWO_DIGITS,
        bit_rate_switch=match["switch"] == "B",
        error_state=match["state"] == "E",
        is_sent=match["direction"] == "TX",
        is_remote=is_remote,
        is_error=is_extended and bool(identifier & ERROR_FRAME),
    )


def _stamp(text: str) -> int:
    if "-" not in text:
        return text_nanoseconds(text)
    date, _, fraction = text.partition(".")
    moment = datetime.strptime(date, "%Y-%m-%d %H:%M:%S")  # local time, as it is printed
    return int(moment.timestamp()) * NANOSECONDS + text_nanoseconds(f"0.{fraction}")
