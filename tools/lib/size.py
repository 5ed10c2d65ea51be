"""Counts the lines of product, tests and tools, and fails when one is above its limit in pyproject.toml.

The limits only ever fall: whoever deletes lowers them, whoever adds takes as many lines away.
"""

import subprocess
import sys
import tomllib
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
FOLDERS = {"product": "observer_rt", "tests": "tests", "tools": "tools"}
SOURCES = {".py", ".pyi", ".pyx", ".pxd", ".pxi", ".c", ".h", ".js", ".css", ".html", ".j2", ".sh", ""}
SLACK = 300  # lines below the limit from which on it is to be lowered


def count_lines(folder: str) -> int:
    """Lines of the source files below a folder that git tracks."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", folder], cwd=REPOSITORY, capture_output=True, text=True, check=True
    ).stdout
    paths = [REPOSITORY / name for name in listed.split("\0") if name]
    return sum(path.read_bytes().count(b"\n") for path in paths if path.suffix in SOURCES and path.is_file())


def main() -> int:
    """Print a line for each part; the exit code: 1 when a limit is exceeded or too high."""
    limits = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["size"]
    code = 0
    for part, folder in FOLDERS.items():
        lines, limit = count_lines(folder), limits[part]
        verdict = "ok"
        if lines > limit:
            verdict, code = "TOO LONG: take lines away", 1
        elif lines < limit - SLACK:
            verdict, code = f"lower the limit in pyproject.toml to {lines}", 1
        print(f"{part:8s} {lines:6d} of {limit:6d} lines  {verdict}")
    return code


if __name__ == "__main__":
    sys.exit(main())
