"""One thing that is written again and again, and what is said when that fails."""

from collections.abc import Callable
from typing import Protocol

from observer_rt.foundation.errors import RunError

Tell = Callable[[str], None]
"""Says a message to whoever runs the daemon; called from the thread that writes."""


class Keepsake(Protocol):
    """Something on disk that follows the daemon."""

    @property
    def name(self) -> str:
        """What it is, with its file."""

    def write(self) -> None:
        """Bring the file up to date. Raises `RunError`; what could not be written is written by a later call."""

    def finish(self) -> str:
        """The last write, whatever was written before; what to say of it. Raises `RunError`."""


class Chore:
    """Tries to write a keepsake, and tells once of what is in its way and once that it is over."""

    def __init__(self, keepsake: Keepsake, interval: float, tell: Tell) -> None:
        """interval [s]: after which it is tried again, for the message."""
        self.keepsake = keepsake
        self.failures = 0
        self._interval = interval
        self._tell = tell
        self._since = 0  # failures before those that go on
        self._told = ""

    def attempt(self) -> None:
        """Write once."""
        try:
            self.keepsake.write()
        except RunError as error:
            self.failures += 1
            if str(error) != self._told:
                self._told = str(error)
                self._tell(
                    f"warning: {error}\n  remedy: make room there, or mend the folder's rights; the observer goes "
                    f"on, and it is tried again every {self._interval:g} s"
                )
        else:
            if self._told:
                failed = self.failures - self._since
                self._tell(f"{self.keepsake.name} is written again, after {failed} failed attempts")
                self._since, self._told = self.failures, ""
