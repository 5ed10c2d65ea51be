"""Records of several groups in order of time, as they come."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray


def in_order_of_time(groups: list[Iterator[NDArray[np.void]]]) -> Iterator[NDArray[np.void]]:
    """The records of all groups by time, those of each group in its own order."""
    waiting = [_WaitingRecords(records) for records in groups]
    while waiting := [each for each in waiting if each.fill()]:
        horizon = min(each.latest for each in waiting)
        parts = [each.taken_to(horizon) for each in waiting]
        times = np.concatenate([time for time, _ in parts])
        yield np.concatenate([part for _, part in parts])[np.argsort(times, kind="stable")]


class _WaitingRecords:
    """Records of one group that are not given on yet; their time is the latest up to each."""

    def __init__(self, coming: Iterator[NDArray[np.void]]) -> None:
        self._coming = coming
        self._records: NDArray[np.void] = np.empty(0, np.void)
        self._times: NDArray[np.int64] = np.empty(0, np.int64)
        self._before = np.iinfo(np.int64).min

    def fill(self) -> bool:
        """Take the next records where none are left; whether there are any."""
        while self._records.size == 0:
            following = next(self._coming, None)
            if following is None:
                return False
            self._records = following
            self._times = np.maximum(np.maximum.accumulate(following["stamp"]), self._before)
        return True

    @property
    def latest(self) -> int:
        return int(self._times[-1])

    def taken_to(self, horizon: int) -> tuple[NDArray[np.int64], NDArray[np.void]]:
        count = int(np.searchsorted(self._times, horizon, side="right"))
        times, taken = self._times[:count], self._records[:count]
        if count:
            self._before = int(times[-1])
        self._times, self._records = self._times[count:], self._records[count:]
        return times, taken
