"""Who plays samples to a running `observer-rt run`, and ends it once they are processed."""

import math
import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from observer_rt.bus.links.link import Link
from observer_rt.recording.replay.framing import TimedFrame
from observer_rt.recording.replay.player import play
from tests.service.end_to_end import Listener
from tests.service.participants import until


@contextmanager
def bench_engineer(
    listener: Listener, player: Link, frames: list[TimedFrame], samples: int
) -> Iterator[None]:
    """Plays as fast as it can when the first status is heard; the last two frames may stay unprocessed."""

    def work() -> None:
        try:
            until(lambda: bool(listener.heard.statuses))
            play(frames, player, math.inf)
            until(lambda: listener.heard.last_status()["SamplesProcessed"] >= samples - 18)
        finally:
            os.kill(os.getpid(), signal.SIGTERM)

    thread = threading.Thread(target=work)
    thread.start()
    yield
    thread.join()
