"""Leaves out what another injector on the same bus has said already."""

import math
import threading
import time

TOGETHER = 10.0  # s within which the same from another injector is the same incident


class Once:
    """Knows what was said of the buses lately, and by whom."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._said: dict[str, tuple[float, set[str]]] = {}

    def is_new(self, who: str, what: str) -> bool:
        """Whether `who` is the first to say it, or says it again."""
        now = time.monotonic()
        with self._lock:
            self._said = {
                text: (when, names) for text, (when, names) in self._said.items() if now - when < TOGETHER
            }
            _, names = self._said.get(what, (-math.inf, {who}))
            if is_new := who in names:
                names = set()
                self._said[what] = now, names
            names.add(who)
            return is_new
