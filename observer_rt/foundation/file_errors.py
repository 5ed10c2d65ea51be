"""What the operating system says of a file, as the two kinds of failure a user can meet."""

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
