"""Files: failures as those a user can meet, hashes, encodings, HTML pages from templates."""

import codecs
import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from observer_rt import __version__
from observer_rt.foundation.errors import RunError, UserError

if TYPE_CHECKING:
    from jinja2 import Environment


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


def file_hash(path: Path) -> str:
    """SHA-256 of a file's content, hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def templates_of(package: str) -> "Environment":
    """The templates in a package's folder `templates`; a name they are not given is an error, but for `version`."""
    from jinja2 import Environment, PackageLoader, StrictUndefined  # commands without a page start without it

    templates = Environment(
        loader=PackageLoader(package),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    templates.globals["version"] = __version__
    return templates


def encoding_of(begin: bytes) -> str:
    """Encoding of a text by its beginning: its byte order mark, else UTF-8 where it is that, else cp1252."""
    if begin.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    try:
        codecs.getincrementaldecoder("utf-8-sig")().decode(begin)
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8-sig"
