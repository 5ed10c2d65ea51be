"""Dates in text logs of Vector's tools, in the languages they are seen in."""

import re
from datetime import datetime

from observer_rt.recording.canlog.can_log import NANOSECONDS, text_nanoseconds

MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")
MONTHS_ELSEWHERE = {"mär": 3, "mrz": 3, "mai": 5, "okt": 10, "dez": 12}
_DATE = re.compile(
    r"(?:\S+\s+)?(?P<month>[^\W\d]+)\.?\s+(?P<day>\d{1,2})\s+"
    r"(?P<hour>\d{1,2}):(?P<minute>\d\d):(?P<second>\d\d)(?:[.,](?P<fraction>\d{1,9}))?"
    r"(?:\s+(?P<half>[ap]m))?\s+(?P<year>\d{4})",
    re.IGNORECASE,
)


def nanoseconds_of(text: str) -> int | None:
    """A date as Vector's tools write it, as local time, in ns since 1970; None in an unknown language."""
    match = _DATE.fullmatch(text)
    if match is None:
        return None
    known = {month.lower(): number for number, month in enumerate(MONTHS, start=1)} | MONTHS_ELSEWHERE
    month = known.get(match["month"].lower())
    hour = int(match["hour"])
    if match["half"]:
        hour = hour % 12 + 12 * (match["half"].lower() == "pm")
    try:
        moment = datetime(
            int(match["year"]),
            month or 0,
            int(match["day"]),
            hour,
            int(match["minute"]),
            int(match["second"]),
        )
        return int(moment.timestamp()) * NANOSECONDS + text_nanoseconds(f"0.{match['fraction'] or 0}")
    except (ValueError, OverflowError):
        return None
