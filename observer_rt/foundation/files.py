"""Files: their kinds, failures, hashes, encodings."""

import codecs
import hashlib
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from observer_rt.foundation.errors import RunError, UserError

_LOOKED_AT = 4096  # bytes of a file, from its beginning


@contextmanager
def file_errors(path: Path) -> Iterator[None]:
    """Turn the operating system's errors on a file the user named into `UserError` and `RunError`."""
    try:
        yield
    except FileNotFoundError:
        raise UserError(str(path), "no such file or folder", "check the path") from None
    except (PermissionError, IsADirectoryError, NotADirectoryError) as error:
        raise UserError(str(path), f"cannot be opened: {error.strerror}", "check path and rights") from None
    except OSError as error:
        raise RunError(f"{path}: {error.strerror or error}") from error


def is_at(path: Path, file: os.stat_result) -> bool:
    """Whether a file that was opened is the one that is there now."""
    try:
        return os.path.samestat(path.stat(), file)
    except FileNotFoundError:
        return False


def file_hash(path: Path) -> str:
    """SHA-256 of a file's content, hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def encoding_of(begin: bytes) -> str:
    """Encoding of a text by its beginning: its byte order mark, else UTF-8 where it is that, else cp1252."""
    if begin.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    try:
        codecs.getincrementaldecoder("utf-8-sig")().decode(begin)
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8-sig"


class FileKind(NamedTuple):
    """A kind of file: its name with an article, and how a file of it begins."""

    name: str
    beginning: re.Pattern[bytes]


def _kind(name: str, beginning: bytes) -> FileKind:
    return FileKind(name, re.compile(beginning, re.MULTILINE))


LEARNED_STATE = _kind(
    "a learned state",
    rb'\A\s*\{\s*"version":\s*\d|"package_version":\s*"[^"]*",\s*"model_sha256":'
    rb'|\A\s*\{\s*("v?e?r?s?i?o?n?"?:?\s*)?\Z',  # cut off at once
)
JOURNAL = _kind("a journal of injections", rb"\ASQLite format 3\0")
SERVICE_LOG = _kind("a log of `observer-rt run`", rb"^\d{4}-\d\d-\d\dT[\d:.]+[+-]\d\d:\d\d [A-Z]+ [a-z]+: ")
INJECTOR_FILE = _kind("an injector file", rb"^\[(fluid|line|seat|nozzle|chamber)\]")
BENCH_FILE = _kind("a bench file", rb"^\[{1,2}(dbc|link|links|signals|outputs|recording|injectors)[].]")
TABLE = _kind("a table of samples", rb"\A(\xef\xbb\xbf)?time_s,")
FINDINGS = _kind("the findings of `discover`", rb'\A\{\s*"schema":\s*\d')
REPRODUCED = _kind("a table of `reproduce`", rb"\Av_H,x3_mse_")
_BY_SUFFIX = {
    ".csv": TABLE,
    ".parquet": _kind("a Parquet file", rb"\APAR1"),
    ".mf4": _kind("an MDF file", rb"\A(MDF     |UnFinMF )"),
    ".log": _kind("a log of candump", rb"^\s*\(\d+\.\d+\) "),
    ".blf": _kind("a log of Vector, binary", rb"\ALOGG"),
    ".asc": _kind("a log of Vector, text", rb"\Adate "),
    ".trc": _kind("a log of PEAK", rb"\A;\$FILEVERSION"),
    ".toml": INJECTOR_FILE,
    ".html": _kind("a page", rb"\A\s*<!(DOCTYPE|doctype) html"),
    ".png": _kind("a PNG figure", rb"\A\x89PNG"),
    ".svg": _kind("an SVG figure", rb"\A\s*<(\?xml|svg)"),
    ".pdf": _kind("a PDF figure", rb"\A%PDF"),
}
_KNOWN = (LEARNED_STATE, JOURNAL, SERVICE_LOG, BENCH_FILE, FINDINGS, *_BY_SUFFIX.values())


def refuse_other_kind(option: str, path: Path, wanted: FileKind | None = None) -> None:
    """Raise `UserError` naming the option where a file is there that we would not have written.

    wanted: by default what its suffix stands for; an unknown suffix, of an installed format, may hold anything.
    A file of nothing, or of zeros as a crash leaves it, is in nobody's way.
    """
    wanted = wanted or _BY_SUFFIX.get(path.suffix.lower())
    if wanted is None or not path.is_file():
        return
    with file_errors(path), path.open("rb") as file:
        content = file.read(_LOOKED_AT)
    if not content.strip(b"\0") or wanted.beginning.search(content):
        return
    actual = next((kind.name for kind in _KNOWN if kind.beginning.search(content)), "something else")
    raise UserError(
        f"{option} {path}",
        f"holds {actual}, not {wanted.name}, and stays as it is",
        "name another file, or move this one away",
    )
