"""Whether the times of a log count from a start or from line to line, where its text does not say, or wrongly."""

SURE_OF_START = 30  # times that are the largest so far
SURE_OF_LINES = 8  # times that differ from the one before


class Rising:
    """Counts times that are the largest so far: of those from a start most are, though frames are swapped."""

    def __init__(self) -> None:
        self._before = 0
        self._largest = 0
        self._rises = 0
        self._changes = 0

    def add(self, time: int) -> None:
        """Take the time of the next line, in any unit."""
        self._changes += time != self._before
        self._before = time
        if time > self._largest:
            self._largest = time
            self._rises += 1

    @property
    def is_from_start(self) -> bool:
        """Whether they surely count from a start."""
        return self._rises >= SURE_OF_START and 2 * self._rises > self._changes

    @property
    def is_from_line_to_line(self) -> bool:
        """Whether they surely are distances."""
        return self._changes >= SURE_OF_LINES and 2 * self._rises < self._changes
