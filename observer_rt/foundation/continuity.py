"""Continuity of samples: why one does not follow the one before, why one cannot be trusted."""

from enum import IntEnum


class Break(IntEnum):
    """Reason why a sample does not follow its predecessor."""

    NONE = 0
    START = 1  # the first sample
    JUMP = 2  # legal jump of a windowed source
    LOSS = 3  # samples were lost
    RESTART = 4  # the device's index began anew


class Doubt(IntEnum):
    """Fault of a sample that is there but cannot be trusted; numbers are those of `stream.state.Reason`."""

    NONE = 0
    TIME_BASE = 16  # when it was taken is not known well enough
    FROZEN = 24  # an input keeps its value for longer than can be bridged
    CLIPPED = 25  # an input stays at the end of its range
