"""A search for what is missing in evidence: `observer-rt discover` as a process of low priority beside the page."""

import asyncio
import json
import re
import time
from asyncio.subprocess import PIPE
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from observer_rt.config.bench import Bench
from observer_rt.desk.question import question, step_back
from observer_rt.foundation.errors import UserError

FINDINGS, REPORT, AMENDED = "findings.json", "report.html", "amended.toml"  # as `discover` names them
FOLDER = "missing"  # of the finding, in that of the evidence
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")


@dataclass(frozen=True)
class MissingFinding:
    """What a search found: findings.json, what `discover` wrote on the screen, and its files."""

    document: dict[str, Any]
    text: str
    report: Path
    amended: Path | None


class MissingSearch:
    """Searches in the evidence of one injector, one search at a time."""

    def __init__(self, alone: Bench) -> None:
        """alone: the bench with this injector only, whose bench file names a folder of evidence."""
        folder = alone.injector.evidence
        assert folder is not None
        self.evidence: Path = folder
        self.failure = ""
        """Why the last search failed; empty: it did not."""
        self._bench = alone
        self._began: float | None = None
        self._text = ""
        self._running: asyncio.Task[None] | None = None  # held, for the loop itself does not

    @property
    def out(self) -> Path:
        """Folder of the finding."""
        return self.evidence / FOLDER

    @property
    def seconds(self) -> float | None:
        """How long it has been searching [s]; None: it is not."""
        return None if self._began is None else time.monotonic() - self._began

    @property
    def kept(self) -> Counter[str]:
        """Events in the folder by kind."""
        return Counter(path.name.partition("_")[0] for path in self.evidence.glob("*.parquet"))

    @property
    def finding(self) -> MissingFinding | None:
        """The last one; None where there is none, or it is being replaced."""
        path = self.out / FINDINGS
        with suppress(OSError, ValueError):
            document = json.loads(path.read_text(encoding="utf-8"))
            amended = self.out / AMENDED
            return MissingFinding(
                document, self._text, self.out / REPORT, amended if amended.exists() else None
            )
        return None

    def start(self) -> None:
        """Search from now on, in the loop that runs. Raises `UserError` where a search is on its way."""
        if self._began is not None:
            raise UserError("search", "is on its way", "wait for it")
        self._began, self.failure = time.monotonic(), ""
        self._running = asyncio.get_running_loop().create_task(self._search())

    async def _search(self) -> None:
        try:
            process = await asyncio.create_subprocess_exec(
                *question(self.evidence, self.out, self._bench.path, self._bench.injector.name),
                stdout=PIPE,
                stderr=PIPE,
                preexec_fn=step_back,
            )
            said, errors = await process.communicate()
        except OSError as error:  # no memory, or no process more
            self.failure = str(error)
        else:
            if process.returncode:
                self.failure = _plain(errors)
            else:
                self._text = _plain(said)
        finally:
            self._began = None


def _plain(text: bytes) -> str:
    return _COLOURS.sub("", text.decode("utf-8", "replace")).strip()
