"""Place of a block of samples in its message's stream: next, repeated, old, or the first of a new count.

Of a repeated block the first wins; an older one is dropped; an index that jumps back or to 0 is a restart of the
device.
"""

from enum import IntEnum


class Placing(IntEnum):
    """Place of a block in its message's stream."""

    ACCEPTED = 0
    REPEATED = 1
    OLD = 2
    RESTARTED = 3  # accepted, as the first of a new count
