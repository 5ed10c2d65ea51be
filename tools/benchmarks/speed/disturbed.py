"""`observer-rt` in a process whose Python is kept busy.

usage: python -m tools.benchmarks.speed.disturbed run --bench FILE
"""

import gc
import threading
import time

from observer_rt.cli.app import main

COLLECTION_PERIOD = 0.1  # s between full garbage collections
CIRCLES = 20_000


def keep_busy() -> None:
    """Compute in Python without pause."""
    number = 1
    while True:
        number = (number * 1_103_515_245 + 12_345) % 2_147_483_648


def collect_garbage() -> None:
    """Make garbage in circles and collect all there is, again and again."""
    while True:
        time.sleep(COLLECTION_PERIOD)
        for _ in range(CIRCLES):
            circle: list[object] = []
            circle.append(circle)
        gc.collect()


if __name__ == "__main__":
    for task in (keep_busy, collect_garbage):
        threading.Thread(target=task, daemon=True).start()
    main()
