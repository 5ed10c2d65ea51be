"""`python -m tests.mutations`: small faults planted one by one, and whether the mirrored tests notice.

In a clone: it writes into the sources. Tests run within --seconds of processor, those of the module's name first.
"""

import random
import re
import resource
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

PACKAGE = Path("observer_rt")
LEAST = 40  # lines of a module
MIRRORS = {
    ".": ("desk/cli",),
    "core/frames": ("bus", "engine/service"),
    "core/identification": ("core/identification", "identification/likelihood"),
    "core/learning": ("engine/estimation", "engine/learning"),
    "core/model": ("model", "plants"),
    "core/paper": ("desk/paper",),
    "core/plant": ("desk/simulation",),
    "core/stream": ("engine/stream", "engine/service"),
}
"""Folders of tests for the command and rooms of the compiled core; every other has one of its own name."""
SWAPS = {" < ": " >= ", " > ": " <= ", " <= ": " > ", " >= ": " < ", " == ": " != ", " + ": " - ", " - ": " + "}
SWAPS |= {" * ": " / ", " and ": " or ", " or ": " and ", "min(": "max(", "max(": "min(", "if not ": "if "}
NUMBER = re.compile(r"(?<![\w.\[])(\d*[1-9]\d*\.\d+|0\.\d*[1-9]\d*|[2-9]\d*)(?![\w.])")
TEXT = re.compile(r"f?\"[^\"]*\"|f?'[^']*'|#.*")
DECLARATION = re.compile(
    r"\s*(from|import|cimport|raise|def|cdef (class|enum)|class|@|ctypedef)\b|\s*_?[A-Z_0-9]+\b.*="
)
"""Lines of no calculation, and constants, whose size a bench judges."""


class Fault(NamedTuple):
    path: Path
    source: str
    words: str


def faults_of(path: Path) -> list[Fault]:
    """All that may be planted in a source: not in its texts, comments, imports and declarations."""
    lines, faults, is_text = path.read_text(encoding="utf-8").splitlines(keepends=True), list[Fault](), False
    for number, line in enumerate(lines):
        marks = line.count('"""')
        is_text ^= marks % 2 == 1
        if is_text or marks or DECLARATION.match(line):
            continue
        code = TEXT.sub(lambda text: "~" * len(text[0]), line)
        places = [(m.start(), old, new) for old, new in SWAPS.items() for m in re.finditer(re.escape(old), code)]
        places += [(m.start(), m[1], f"({m[1]} * 2)") for m in NUMBER.finditer(code)]
        for start, old, new in places:
            other = [*lines[:number], line[:start] + new + line[start + len(old) :], *lines[number + 1 :]]
            faults.append(Fault(path, "".join(other), f"{path}:{number + 1}: {old.strip()} -> {new.strip()}"))
    return faults


def tests_of(path: Path) -> list[str]:
    """The test file of this name, those that import the module, then the others of the room's folders."""
    room = path.relative_to(PACKAGE).parent
    folders = [Path("tests", folder) for folder in MIRRORS.get(str(room), (room,))]
    folders = [next(f for f in (folder, *folder.parents) if f.is_dir()) for folder in folders]
    package = ".".join(path.parent.parts)
    imports = re.compile(rf"^(from|import) {package}(\.| import .*\b){path.stem}\b", re.MULTILINE)
    files = [file for folder in folders for file in sorted(folder.rglob("test_*.py"))]
    own = [file for file in files if file.stem == f"test_{path.stem}"]
    near = [file for file in files if file not in own and imports.search(file.read_text(encoding="utf-8"))]
    return [str(file) for file in dict.fromkeys([*own, *near, *files])]


def drawn(seed: int, count: int) -> Iterator[Fault]:
    draw, rooms = random.Random(seed), dict[str, list[Path]]()
    for path in sorted(PACKAGE.rglob("*")):
        if path.suffix in {".py", ".pyx", ".pxd", ".pxi"} and path.read_text(encoding="utf-8").count("\n") >= LEAST:
            depth = 3 if path.parts[1] in {"core", "engine"} else 2
            rooms.setdefault("/".join(path.parts[1:depth]), []).append(path)
    for paths in rooms.values():
        draw.shuffle(paths)
    while any(rooms.values()):
        for paths in rooms.values():
            if paths and (faults := faults_of(paths.pop())) and count:
                count -= 1
                yield draw.choice(faults)


def verdict_on(fault: Fault, seconds: int) -> tuple[str, float]:
    """Whether the tests notice a fault: `killed`, `lives` or `unknown`, and the seconds of processor until then."""
    original, begun = fault.path.read_bytes(), _seconds_of_children()
    try:
        fault.path.write_text(fault.source, encoding="utf-8")
        if fault.path.suffix != ".py":
            if subprocess.run([sys.executable, "tools/lib/build_core.py"], capture_output=True).returncode:
                return "no fault: does not compile", 0.0
            begun = _seconds_of_children()
        code = subprocess.run(
            [sys.executable, "-m", "pytest", "-xq", "-m", "not slow and not vcan", *tests_of(fault.path)],
            capture_output=True,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds)),
        ).returncode
    finally:
        fault.path.write_bytes(original)
    return {0: "lives", 1: "killed", 2: "killed", 4: "killed"}.get(code, "unknown"), _seconds_of_children() - begun


def _seconds_of_children() -> float:
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def main(
    seed: Annotated[int, typer.Option()] = 1,
    count: Annotated[int, typer.Option(help="of faults")] = 60,
    seconds: Annotated[int, typer.Option(help="of processor, for each fault")] = 60,
) -> None:
    verdicts = []
    for fault in drawn(seed, count):
        verdict, spent = verdict_on(fault, seconds)
        verdicts.append(verdict)
        print(f"{verdict:8s} {spent:6.1f} s  {fault.words}", flush=True)
    print(*(f"{verdicts.count(verdict)} {verdict}" for verdict in sorted(set(verdicts))), sep=", ")


if __name__ == "__main__":
    typer.run(main)
