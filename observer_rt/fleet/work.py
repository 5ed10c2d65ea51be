"""What a batch works with, whatever it does."""

import threading
from dataclasses import dataclass

from rich.console import Console

from observer_rt.fleet.cluster import Cluster
from observer_rt.foundation.errors import RunError


@dataclass(frozen=True)
class Work:
    """Workers; stop: set when the user wants no more; console: for progress and messages."""

    cluster: Cluster
    stop: threading.Event
    console: Console

    def refuse_interrupted(self, done: int, of: int, what: str) -> None:
        """Raise `RunError` where the user wants no more; done, of: how many of what."""
        if self.stop.is_set():
            raise RunError(
                f"interrupted; {done} of {of} {what} are done\n  remedy: give the same command again to go on"
            )
