"""Programs in C that the observer is measured with and against, compiled when they are needed."""

import shutil
import subprocess
from pathlib import Path

from observer_rt.foundation.errors import UserError

_FOLDER = Path(__file__).parent
_FLAGS = ("-O3", "-march=native", "-fno-math-errno", "-Wall")
"""As the core is compiled: for this processor, without `errno`, and without `-ffast-math`."""


def program(name: str, folder: Path) -> Path:
    """The program `name`.c, compiled into a folder. Raises UserError."""
    return _compiled(name, folder / name, ())


def library(name: str, folder: Path) -> Path:
    """The same as a shared library."""
    return _compiled(name, folder / f"{name}.so", ("-shared", "-fPIC"))


def _compiled(name: str, target: Path, flags: tuple[str, ...]) -> Path:
    if target.exists():
        return target
    compiler = shutil.which("cc")
    if compiler is None:
        raise UserError("tools/bench speed", "there is no C compiler `cc`", "apt-get install gcc")
    command = [compiler, *_FLAGS, *flags, "-o", str(target), str(_FOLDER / f"{name}.c"), "-lm"]
    subprocess.run(command, check=True)
    return target
