"""Samples of a recording that are not there."""

import numpy as np
from numpy.typing import NDArray


class MissingSamples:
    """Counts samples, those that are missing, and the gaps these make, while a recording is read."""

    def __init__(self) -> None:
        self.samples = 0
        """Of the recording."""
        self.missing = 0
        """Of these."""
        self.count = 0
        """Of gaps."""
        self.longest = 0
        """[samples]"""
        self._open = 0  # samples of a gap that may go on

    def take(self, missing: NDArray[np.bool_]) -> None:
        """Go on with further samples (n,)."""
        edges = np.flatnonzero(np.diff(missing, prepend=False, append=False))
        lengths = edges[1::2] - edges[::2]
        self.samples += missing.size
        self.missing += int(lengths.sum())
        self.count += lengths.size
        if self._open and missing.size:
            if missing[0]:
                lengths[0] += self._open
                self.count -= 1
            self._open = 0
        if lengths.size:
            self.longest = max(self.longest, int(lengths.max()))
            self._open = int(lengths[-1]) if missing[-1] else 0
