"""The word that whoever presses a button of the page must know, and how often it may be guessed."""

import hmac
import secrets
import time
from collections.abc import Callable
from enum import Enum

BYTES = 16  # of the word
FIRST_DELAY, LONGEST_DELAY = 0.5, 10.0  # s


class WordResult(Enum):
    """What comes of a word that somebody says, in words for them."""

    RIGHT = ""
    WRONG = "The word is not that which `observer-rt monitor` has written on its terminal."
    TOO_EARLY = "A wrong word was said a moment ago. Press again in some seconds."


class SecretWord:
    """A word made at random. After a wrong one none is looked at for a while, whoever says it: longer each time."""

    def __init__(self, tell: Callable[[str], None], now: Callable[[], float] = time.monotonic) -> None:
        """tell: hears of the 1st, 2nd, 4th, 8th ... wrong word; now: the time [s]."""
        self.text = secrets.token_urlsafe(BYTES)
        self._tell = tell
        self._now = now
        self._failures = self._in_a_row = 0
        self._open_from = now()

    def check(self, said: str, who: str | None) -> WordResult:
        """Check a word; who: the address it comes from."""
        if self._now() < self._open_from:
            return WordResult.TOO_EARLY
        if hmac.compare_digest(said.encode(), self.text.encode()):
            self._in_a_row = 0
            return WordResult.RIGHT
        self._open_from = self._now() + min(FIRST_DELAY * 2.0**self._in_a_row, LONGEST_DELAY)
        self._in_a_row = min(self._in_a_row + 1, 10)
        self._failures += 1
        if self._failures & (self._failures - 1) == 0:
            self._tell(
                f"a wrong word for the page's buttons, the last one from {who}: {self._failures} so far"
            )
        return WordResult.WRONG
