"""Reading and writing recordings, the format chosen by the file's suffix."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from observer_rt.foundation.errors import RunError, UserError
from observer_rt.recording.signals.csv_file import read_csv, write_csv
from observer_rt.recording.signals.mdf4_file import read_mdf4, write_mdf4
from observer_rt.recording.signals.recording import Recording

READERS = {".csv": read_csv, ".mf4": read_mdf4}
WRITERS = {".csv": write_csv, ".mf4": write_mdf4}


def read_recording(path: Path) -> Recording:
    """Read a `.csv` or `.mf4` recording.

    Raises `UserError` for an unknown suffix, a file that cannot be opened or whose content is wrong.
    """
    reader = READERS[_known_suffix(path)]
    with file_errors(path):
        return reader(path)


def write_recording(path: Path, recording: Recording) -> None:
    """Write a `.csv` or `.mf4` recording, replacing an existing file.

    Raises `UserError` for an unknown suffix or a path that cannot be written, `RunError` when writing fails.
    """
    writer = WRITERS[_known_suffix(path)]
    with file_errors(path):
        writer(path, recording)


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


def _known_suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix not in READERS:
        raise UserError(
            str(path), f"unknown kind of recording '{path.suffix}'", f"known suffixes: {', '.join(READERS)}"
        )
    return suffix
