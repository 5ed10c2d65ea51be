"""A program to ask in the place of `observer-rt`: it notes what it is told, and answers that nothing is wrong."""

import json
import sys
from collections.abc import Iterable
from pathlib import Path

from rich.console import Console

from tools.benchmarks.report import Shown

STUB = """
import json, pathlib, sys

verb, arguments = sys.argv[1], sys.argv[2:]
if verb == "fit":
    recordings, header = [], ""
    model = pathlib.Path(arguments[arguments.index("--model") + 1]).read_text()
    pathlib.Path(arguments[arguments.index("--output") + 1]).write_text(model)
else:
    out = pathlib.Path(arguments[arguments.index("--out") + 1])
    recordings = [each for each in arguments if each.endswith(".csv")]
    header = pathlib.Path(recordings[0]).open().readline()
    if len(recordings) == 6 and FAILS.exists():
        FAILS.unlink()
        sys.exit("no luck")
    out.mkdir(parents=True)
    (out / "findings.json").write_text(json.dumps({"verdict": "none", "effects": [], "amended_model": None}))
with open(LOG, "a") as log:
    log.write(json.dumps([verb, arguments, recordings, header.count(",")]) + chr(10))
"""


class Stub:
    """The program. fails_once: the next time it is asked about a case, not to compile."""

    def __init__(self, folder: Path, fails_once: bool = False) -> None:
        self._log, path, fails = folder / "log.txt", folder / "stub.py", folder / "fails"
        path.write_text(
            STUB.replace("LOG", repr(str(self._log))).replace("FAILS", f"pathlib.Path({str(fails)!r})")
        )
        if fails_once:
            fails.touch()
        self.program = (sys.executable, str(path))

    def calls(self) -> list[tuple[str, list[str], list[str], int]]:
        """Verb, arguments, recordings and commas in the first header of every call."""
        return [tuple(json.loads(line)) for line in self._log.read_text().splitlines()]


def printed(parts: Iterable[Shown]) -> str:
    """Tables and lines as they stand on a screen."""
    console = Console(width=200)
    with console.capture() as told:
        for part in parts:
            console.print(part, highlight=False, markup=False)
    return told.get()
