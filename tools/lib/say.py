"""Messages of tools/vcan: progress on stderr, and the one failure it knows."""

from __future__ import annotations

import sys


def say(message: str) -> None:
    """Print progress for the user on stderr."""
    print(f"vcan: {message}", file=sys.stderr, flush=True)


class UnableError(Exception):
    """vcan0 cannot be had; `mend` is the one command that would change that, `details` what others said."""

    def __init__(self, problem: str, mend: str, details: str = "") -> None:
        super().__init__(problem)
        self.mend = mend
        self.details = details


class KernelError(UnableError):
    """This user-mode Linux cannot be had or does not run; another one may."""
