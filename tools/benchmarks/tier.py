"""Which plant is measured."""

from enum import StrEnum


class Tier(StrEnum):
    """A: of the nominal structure; B: richer, with travelling waves."""

    A = "A"
    B = "B"
