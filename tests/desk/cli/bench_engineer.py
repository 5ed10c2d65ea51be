"""Who plays frames to a running `observer-rt run`, and ends it once they are processed."""

import math
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from observer_rt.bus.links.opening import open_link
from observer_rt.config.bench import load_bench
from observer_rt.files.replay.framing import TimedFrame
from observer_rt.files.replay.player import play
from tests.daemon.end_to_end import ResultFrames
from tests.daemon.participants import BLOCK_ID, listening, until
from tests.desk.cli.conftest import Command, Outcome
from tests.device import frames_of
from tests.meanwhile import meanwhile


@contextmanager
def ended_when(
    done: Callable[[], bool], first: Callable[[], object], number: signal.Signals = signal.SIGTERM
) -> Iterator[None]:
    """Beside a command: do something first, then act, and send it a signal."""

    def work(_: threading.Event) -> None:
        try:
            first()
            until(done)
        finally:
            os.kill(os.getpid(), number)

    with meanwhile(work):
        yield


def run_and_stop(
    command: Command,
    bench: Path,
    sent: Path | Sequence[TimedFrame],
    *options: object,
    number: signal.Signals = signal.SIGTERM,
    meanwhile: Callable[[], bool] = lambda: True,
) -> tuple[Outcome, ResultFrames]:
    """Play to the command over the virtual bus at full speed, then signal it; two frames may stay unprocessed."""
    channel = load_bench(bench).config.link.channel
    frames = frames_of(bench, sent) if isinstance(sent, Path) else list(sent)
    samples = 9 * (sum(frame.frame_id == BLOCK_ID for frame in frames) - 2)
    with listening("virtual", channel) as listener, open_link("virtual", channel, True, []) as player:
        results = listener.results

        def first() -> None:
            until(lambda: bool(results.statuses))
            play(frames, player, math.inf)

        def done() -> bool:
            return results.last_status()["SamplesProcessed"] >= samples and meanwhile()

        with ended_when(done, first, number):
            outcome = command("run", "--bench", bench, *options)
        time.sleep(0.2)  # for the listener to hear the last frames
    return outcome, results
