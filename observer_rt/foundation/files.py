"""Files: their failures as those a user can meet, their content as a hash, and replacing one once complete."""

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from observer_rt.foundation.errors import RunError, UserError


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


@contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """A file beside the target that takes its place if all goes well, and else is gone."""
    part = target.with_name(f".{target.stem}.part{target.suffix}")
    try:
        yield part
        part.replace(target)
    except UserError as error:
        raise UserError(error.place.replace(str(part), str(target)), error.problem, error.remedy) from None
    finally:
        part.unlink(missing_ok=True)
