"""Frequency of Python's garbage collection."""

import gc


def collect_seldom() -> None:
    """Look for garbage after 50,000 objects instead of 700.

    Starting makes many that stay: a tenth of the time goes by looking through them again and again.
    """
    gc.set_threshold(50_000, 5, 2)
