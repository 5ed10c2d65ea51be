"""What a batch works with, whatever it does."""

import threading
from dataclasses import dataclass

from rich.console import Console

from observer_rt.fleet.cluster import Cluster


@dataclass(frozen=True)
class Work:
    """Workers; stop: set when the user wants no more; console: for progress and messages."""

    cluster: Cluster
    stop: threading.Event
    console: Console
