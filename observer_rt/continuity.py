"""How one sample follows another: the word that alignment and observer share."""

from enum import IntEnum


class Break(IntEnum):
    """Why a sample does not follow its predecessor."""

    NONE = 0
    START = 1  # the first sample
    JUMP = 2  # legal jump of a windowed source
    LOSS = 3  # samples were lost
    RESTART = 4  # the device's index began anew
