"""Changes the injector file that a bench file names, and keeps the history of such changes beside it."""

import json
import os
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_errors
from observer_rt.foundation.outputs import replacing, write_text

_MARK = "\ufeff"  # at the beginning of files by some editors
HISTORY = ".taken_over.json"  # behind the name of the bench file


def naming(path: Path, content: bytes, injector: str, file: str | None) -> bytes:
    """Content of a bench file that names an injector file for one of its injectors; None: that of the package.

    Raises `UserError` for a text that cannot be changed.
    """
    text = content.decode("utf-8")
    mark, text = (_MARK, text[1:]) if text.startswith(_MARK) else ("", text)
    try:
        document: Any = tomlkit.parse(text)
    except TOMLKitError as error:
        raise UserError(
            str(path), f"cannot be changed as text: {error}", "name the file by hand: [model] file"
        ) from None
    section = document["injectors"][injector] if injector else document
    if file is not None:
        section.setdefault("model", tomlkit.table())["file"] = file
    elif "model" in section:
        section["model"].pop("file", None)
    changed = tomlkit.dumps(document)
    if "\r\n" in text and not re.search(r"(?<!\r)\n", text):  # the added lines get the file's line ends
        changed = re.sub(r"(?<!\r)\n", "\r\n", changed)
    return (mark + changed).encode("utf-8")


def replace_text(path: Path, content: bytes) -> None:
    """Replace a bench file in one step; its rights and owner stay."""
    owner = path.stat()
    with file_errors(path), replacing(path) as part:
        part.write_bytes(content)
        with suppress(PermissionError):
            os.chown(part, owner.st_uid, owner.st_gid)


@dataclass(frozen=True)
class TakeOver:
    """One change: the injector, the file that the bench named before (None: none) and after, and the time.

    learned_from: number of kept events from which the new model learned before it was put into force.
    """

    injector: str
    before: str | None
    after: str
    time: str
    learned_from: int = 0

    @property
    def as_text(self) -> str:
        """The file that the bench names now, and the origin of its learned state."""
        learned = f", with what {self.learned_from} events of the evidence taught it" if self.learned_from else ""
        return f"{self.after}{learned}"


def steps(path: Path) -> list[TakeOver]:
    """Steps that were not undone, the oldest first."""
    history = path.with_name(path.name + HISTORY)
    if not history.exists():
        return []
    with file_errors(history):
        try:
            return [TakeOver(**step) for step in json.loads(history.read_text(encoding="utf-8"))]
        except (ValueError, TypeError):
            raise UserError(str(history), "is no history of models taken over", "move it away") from None


def note_steps(path: Path, done: Sequence[TakeOver]) -> None:
    """Note the steps that were taken."""
    history = path.with_name(path.name + HISTORY)
    if not done:
        with file_errors(history):
            history.unlink(missing_ok=True)
        return
    write_text(history, json.dumps([asdict(step) for step in done], indent=2) + "\n")
