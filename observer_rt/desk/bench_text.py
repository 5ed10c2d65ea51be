"""The text of a bench file with another injector file in it: comments, layout and ends of lines as they were."""

import os
import re
from contextlib import suppress
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_errors
from observer_rt.foundation.outputs import replacing

_MARK = "\ufeff"  # at the beginning of files by some editors


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
    if "\r\n" in text and not re.search(r"(?<!\r)\n", text):  # what is added ends as all else does
        changed = re.sub(r"(?<!\r)\n", "\r\n", changed)
    return (mark + changed).encode("utf-8")


def replace_text(path: Path, content: bytes) -> None:
    """Replace a bench file as a whole, with its rights and owner."""
    owner = path.stat()
    with file_errors(path), replacing(path) as part:
        part.write_bytes(content)
        with suppress(PermissionError):
            os.chown(part, owner.st_uid, owner.st_gid)
