"""Stamps of a calendar as seconds."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.injector import TimeConfig
from observer_rt.foundation.errors import UserError

ISO_8601 = "ISO8601"  # as pandas calls it
_ISO = re.compile(r"\s*\d{4}-\d\d-\d\d[T ]\d\d:\d\d")
NO_MOMENT = np.iinfo(np.int64).min  # as NumPy and pandas have it


@dataclass(frozen=True)
class Calendar:
    """Format of the stamps, as of strptime, or `ISO_8601`. Without a zone they count as UTC."""

    form: str

    def nanoseconds(self, cells: Any) -> NDArray[np.int64]:
        """Nanoseconds since 1970 of stamps (n,); `NO_MOMENT` for invalid ones."""
        import pandas  # slow to import

        try:
            stamps = pandas.to_datetime(pandas.Series(cells), format=self.form, errors="coerce", utc=True)
        except ValueError as error:
            raise UserError(
                f"[recording.time] format = '{self.form}'",
                str(error),
                "write it as '%d.%m.%Y %H:%M:%S.%f', with the letters of strptime",
            ) from None
        moments: NDArray[np.int64] = stamps.dt.tz_localize(None).to_numpy("datetime64[ns]").astype(np.int64)
        return moments

    def as_text(self, origin: int) -> str:
        """Description of how the stamps are read."""
        form = "ISO 8601" if self.form == ISO_8601 else f"'{self.form}'"
        return f"calendar stamps as {form}, counted from {np.datetime64(origin, 'ns')}"


def calendar_of(time: TimeConfig | None, cells: Iterable[str]) -> Calendar | None:
    """Calendar of a column: as stated, or ISO 8601 where a cell looks so and no unit is stated. None: numbers."""
    if time is not None and time.format is not None:
        return Calendar(time.format)
    if (time is None or time.unit is None) and any(_ISO.match(cell) for cell in cells):
        return Calendar(ISO_8601)
    return None


def seconds_since(origin: int, moments: NDArray[np.int64]) -> NDArray[np.float64]:
    """Moments or times [ns] (n,) as seconds since `origin` [ns], exact as those since 1970 are not; NaN of none."""
    return np.where(moments == NO_MOMENT, np.nan, (moments - origin) / 1e9)
