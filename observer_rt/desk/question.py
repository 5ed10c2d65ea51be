"""The question what is missing, asked of evidence beside the daemon that keeps it."""

import os
import sys
from pathlib import Path

NICE = 15  # of a question asked beside a daemon


def question(evidence: Path, out: Path, bench: Path | None = None, injector: str = "") -> list[str]:
    """Command that asks evidence in a process of its own, and takes the first proposal into the amended model."""
    named = [*(["--bench", str(bench)] if bench else []), *(["--injector", injector] if injector else [])]
    asked = [sys.executable, "-m", "observer_rt", "discover", "--from-evidence", str(evidence), *named]
    return [*asked, "--out", str(out), "--accept-term", "1", "--force"]


def step_back() -> None:
    """Let whoever serves a bus come first: for the process that asks."""
    os.nice(NICE)
