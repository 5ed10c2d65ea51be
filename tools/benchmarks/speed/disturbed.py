"""`observer-rt` in a process whose Python is disturbed.

usage: python -m tools.benchmarks.speed.disturbed busy|paused run --bench FILE

busy: a thread computes in Python without pause. paused: all Python is held up at random. Both: a full garbage
collection every 100 ms.
"""

import ctypes
import gc
import random
import sys
import threading
import time

from observer_rt.desk.cli.app import main
from observer_rt.foundation.units import MICROSECOND

COLLECTION_PERIOD = 0.1  # s between full garbage collections
CIRCLES = 20_000
PAUSES = 1.0  # s from one to the next, the mean
LONGEST_PAUSE = 0.05  # s


def keep_busy() -> None:
    """Compute in Python without pause."""
    number = 1
    while True:
        number = (number * 1_103_515_245 + 12_345) % 2_147_483_648


def pause_at_random() -> None:
    """Sleep with the interpreter's lock held: no Python runs meanwhile, in any thread."""
    sleep_locked = ctypes.PyDLL(None).usleep
    while True:
        time.sleep(random.expovariate(1.0 / PAUSES))
        sleep_locked(round(random.uniform(0.0, LONGEST_PAUSE) / MICROSECOND))


def collect_garbage() -> None:
    """Make garbage in circles and collect all there is, again and again."""
    while True:
        time.sleep(COLLECTION_PERIOD)
        for _ in range(CIRCLES):
            circle: list[object] = []
            circle.append(circle)
        gc.collect()


DISTURBANCES = {"busy": keep_busy, "paused": pause_at_random}


if __name__ == "__main__":
    for task in (DISTURBANCES[sys.argv.pop(1)], collect_garbage):
        threading.Thread(target=task, daemon=True).start()
    main()
