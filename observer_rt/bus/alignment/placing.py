"""Where a block of samples belongs in its message's stream: next, repeated, old, or the first of a new count.

Of a repeated block the first wins; an older one is dropped; an index that jumps back or to 0 is a restart of the
device.

Resamples what lies between the samples of the grid, or further apart.

A rail pressure of another time base, or a slower one, has on the grid the value that lies between its two neighbours.
Neighbours too far apart are not joined: what lies between them is missing.
What is a mean over the sample period that ends at a sample's time is of half a period before: on the grid, too, it
follows, as if it were sampled there.
A lift stays as it was sampled, with the time by which that was later: straight lines would cut off the corners of its
ramps, which at 20 kHz is worth up to 3 % of the mass.
"""

from enum import IntEnum


class Placing(IntEnum):
    """What became of a block."""

    ACCEPTED = 0
    REPEATED = 1
    OLD = 2
    RESTARTED = 3  # accepted, as the first of a new count
