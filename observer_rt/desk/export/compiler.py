"""The machine's C compiler, where it has one."""

import platform
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from observer_rt.foundation.errors import RunError

COMPILERS = ("cc", "gcc", "clang")
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off")
_LONGEST = 300.0  # s


class Binary(NamedTuple):
    """Folders of a shared library in an FMU of version 2 and 3, and its suffix."""

    fmi2: str
    fmi3: str
    suffix: str


def compiler() -> str | None:
    """Path of a C compiler; None: there is none."""
    return next((found for name in COMPILERS if (found := shutil.which(name))), None)


def binary() -> Binary | None:
    """What FMI calls this machine; None where it has no name for it that 2.0 has, too."""
    if platform.machine().lower() not in ("x86_64", "amd64"):
        return None
    names = {
        "linux": Binary("linux64", "x86_64-linux", ".so"),
        "darwin": Binary("darwin64", "x86_64-darwin", ".dylib"),
    }
    return names.get(sys.platform)


def compile_c(found: str, folder: Path, sources: Sequence[str], output: Path, *flags: str) -> None:
    """Compile sources of a folder to a program, or by `flags` to a library. Raises `RunError` where that fails."""
    command = [found, *FLAGS, *flags, "-o", str(output.absolute()), *sources, "-lm"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=_LONGEST, check=False)
    if done.returncode != 0:
        raise RunError(f"{found} does not compile what was exported:\n{done.stderr.strip()}")
