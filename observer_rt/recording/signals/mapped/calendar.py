"""Columns of a CSV file that say the time by the calendar."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.recording import TimeConfig
from observer_rt.foundation.errors import UserError
from observer_rt.recording.signals.mapped.cells import is_missing

_ISO = re.compile(r"\s*\d{4}-\d\d-\d\d[T ]\d\d:\d\d")
ISO_8601 = "ISO8601"  # as pandas calls it
NANOSECONDS = 1e9  # a second


@dataclass(frozen=True)
class Calendar:
    """How the stamps are written, as of strptime, or `ISO_8601`. Without a zone they count as UTC."""

    form: str

    def is_stamp(self, cell: str) -> bool:
        """Whether a cell is a stamp, or says that there is none."""
        return is_missing(cell) or bool(self.nanoseconds([cell])[0] != _NONE)

    def nanoseconds(self, cells: Any) -> NDArray[np.int64]:
        """Of stamps (n,) since 1970; those that are none are below all others."""
        import pandas  # slow to import

        try:
            stamps = pandas.to_datetime(pandas.Series(cells), format=self.form, errors="coerce", utc=True)
        except ValueError as error:
            raise UserError(
                f"[recording.time] format = '{self.form}'",
                str(error),
                "write it as '%d.%m.%Y %H:%M:%S.%f', with the letters of strptime",
            ) from None
        found: NDArray[np.int64] = stamps.dt.tz_localize(None).to_numpy("datetime64[ns]").astype(np.int64)
        return found

    def seconds(self, cells: Any, origin: int) -> NDArray[np.float64]:
        """Of stamps (n,) since `origin` [ns]: exact, which seconds since 1970 are not. NaN of those that are none."""
        found = self.nanoseconds(cells)
        return np.where(found == _NONE, np.nan, (found - origin) / NANOSECONDS)

    def as_text(self, origin: int) -> str:
        """What is made of the stamps."""
        form = "ISO 8601" if self.form == ISO_8601 else f"'{self.form}'"
        return f"calendar stamps as {form}, counted from {np.datetime64(origin, 'ns')}"


_NONE = np.iinfo(np.int64).min  # as NumPy and pandas have it


def calendar_of(time: TimeConfig, cells: Iterable[str]) -> Calendar | None:
    """That of a column: as stated, or ISO 8601 where a cell looks so and no unit is stated. None: numbers."""
    if time.format is not None:
        return Calendar(time.format)
    if time.unit is None and any(_ISO.match(cell) for cell in cells):
        return Calendar(ISO_8601)
    return None
