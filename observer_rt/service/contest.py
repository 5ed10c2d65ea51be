"""Another node sends what only this service should: then no receiver knows whose frame it has, and none is valid."""

import numpy as np
from numpy.typing import NDArray


class Contest:
    """Whether there is a second sender now, and the samples between which there was one last."""

    def __init__(self, publisher: NDArray[np.void], observer: NDArray[np.void]) -> None:
        """publisher, observer: the memory of either; no rate that the publisher sends meanwhile is valid."""
        self._is_contested = publisher["contested"]
        self._processed = observer["processed"]
        self._first = self._end = 0

    def note(self, is_contested: bool) -> None:
        """Whether there is one; the stream may go on meanwhile."""
        if is_contested == self._is_contested[0]:
            return
        if is_contested:
            self._first = int(self._processed[0])
        self._is_contested[0] = is_contested
        if not is_contested:
            self._end = int(self._processed[0])

    def concerns(self, injection: np.void) -> bool:
        """Whether what is reported now of an injection, `stream.state.INJECTION`, is contested, or its rates were."""
        was_contested = injection["end"] >= self._first and injection["start"] < self._end
        return bool(self._is_contested[0] or was_contested)
