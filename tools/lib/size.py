"""Counts the lines of product, tests and tools, and fails when one is above its limit in pyproject.toml.

The limits only ever fall: whoever deletes lowers them, whoever adds takes as many lines away.
"""

import subprocess
import sys
import tomllib
from collections.abc import Mapping
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
FOLDERS = {"product": "observer_rt", "tests": "tests", "tools": "tools"}
SOURCES = {".py", ".pyi", ".pyx", ".pxd", ".pxi", ".c", ".h", ".js", ".css", ".html", ".j2", ".sh", ""}
SLACK = 300  # lines below the limit from which on it is to be lowered


def tracked_files(folder: str) -> list[Path]:
    """Files below a folder that git tracks."""
    listed = subprocess.check_output(["git", "ls-files", "-z", folder], cwd=REPOSITORY, text=True)
    return [path for name in listed.split("\0") if name and (path := REPOSITORY / name).is_file()]


def exit_code(section: str, counts: Mapping[str, int], unit: str, slack: int, remedy: str) -> int:
    """Print a line for each part; 1 when a limit of `[tool.SECTION]` is exceeded or too high."""
    limits = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["tool"][section]
    code = 0
    for part, count in counts.items():
        limit, verdict = limits[part], "ok"
        if count > limit:
            verdict, code = f"TOO MANY: {remedy}", 1
        elif count < limit - slack:
            verdict, code = f"lower the limit in pyproject.toml to {count}", 1
        print(f"{part:8s} {count:6d} of {limit:6d} {unit}  {verdict}")
    return code


def main() -> int:
    """Lines of the source files, against `[tool.size]`."""
    lines = {
        part: sum(path.read_bytes().count(b"\n") for path in tracked_files(folder) if path.suffix in SOURCES)
        for part, folder in FOLDERS.items()
    }
    return exit_code("size", lines, "lines", SLACK, "take lines away")


if __name__ == "__main__":
    sys.exit(main())
