"""The command as a user starts it, in a process of its own, and the processes that work for it."""

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import psutil

PATIENCE = 600.0  # s
PATTERN = ("--injector-from", r"injector_(\w+)")


def started(*arguments: str | Path, cwd: Path | None = None) -> "subprocess.Popen[str]":
    """`observer-rt batch` with two workers of its own unless a scheduler is named, its results as JSON."""
    words = [sys.executable, "-m", "observer_rt", "batch", *map(str, arguments), "--json", *PATTERN]
    workers = () if "--scheduler" in arguments else ("--workers", "2")
    return subprocess.Popen([*words, *workers], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=cwd)


def ended(process: "subprocess.Popen[str]") -> dict[str, Any]:
    out, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, err
    said: dict[str, Any] = json.loads(out)
    return said


def workers_of(process: "subprocess.Popen[str]") -> Sequence[psutil.Process]:
    """The processes that evaluate: what the command has started, but for the tracker of their resources."""
    children = psutil.Process(process.pid).children(recursive=True)
    return [each for each in children if "spawn_main" in " ".join(each.cmdline())]
