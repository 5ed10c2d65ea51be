"""Waits for a child process group, passing signals on to it and bounding how long it may take."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from say import say

FORWARDED = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
GRACE_S = 10.0  # what a command may take to end after the first signal before it is killed
POLL_S = 0.02
TIMED_OUT = 124  # exit code, as timeout(1)

# Waits for a line; when its input ends without one, the program that would have sent it has died.
WATCHER = 'read -r line || { kill -9 "-$1"; [ -z "$2" ] || rm -rf "$2"; }'


@contextlib.contextmanager
def outlived_by_nothing(process: subprocess.Popen[bytes], folder: Path | None) -> Iterator[None]:
    """While the block runs: should this program be killed, the group of `process` and `folder` go with it."""
    words = ["sh", "-c", WATCHER, "sh", str(process.pid), str(folder or "")]
    watcher = subprocess.Popen(words, stdin=subprocess.PIPE, stderr=subprocess.DEVNULL, start_new_session=True)
    try:
        yield
    finally:
        watcher.communicate(b"done\n")


def supervise(
    process: subprocess.Popen[bytes], deliver: Callable[[int], None], timeout_s: float, folder: Path | None = None
) -> int | None:
    """Wait until `process`, leader of its own group, has ended; nothing of the group is left afterwards.

    The first of SIGINT, SIGTERM and SIGHUP is handed to `deliver`; the second, or `GRACE_S` gone by, kills
    the group. `folder` is the temporary folder of the caller, see `outlived_by_nothing`.
    Returns None if the process ended by itself, else the exit code to report: `TIMED_OUT`, or 128 + signal.
    """
    signals: list[int] = []

    def note(number: int, _frame: object) -> None:
        signals.append(number)

    previous = {number: signal.signal(number, note) for number in FORWARDED}
    end = time.monotonic() + timeout_s
    delivered = False
    with outlived_by_nothing(process, folder):
        try:
            while process.poll() is None:
                if signals and not delivered:
                    deliver(signals[0])
                    delivered = True
                    end = min(end, time.monotonic() + GRACE_S)
                if len(signals) > 1 or time.monotonic() > end:
                    if signals:
                        return 128 + signals[0]
                    say(f"killing the command after {timeout_s:g} s (VCAN_TIMEOUT)")
                    return TIMED_OUT
                time.sleep(POLL_S)
            return None
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            for number, handler in previous.items():
                signal.signal(number, handler)
