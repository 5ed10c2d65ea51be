"""One process at a time writes a file that is replaced as a whole."""

import contextlib
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

from observer_rt.foundation.errors import UserError

LONGEST_ID = 20  # digits of a process id


@contextlib.contextmanager
def sole_writer(path: Path) -> Iterator[None]:
    """Be the only process that writes the file at `path`, by a lock on `NAME.lock` beside it.

    The lock ends with its process however that ends; the file left behind by a killed one is in nobody's way.

    Raises:
        UserError: another process has it, which is named, or no lock can be made there.
    """
    lock = Path(os.path.realpath(path) + ".lock")
    descriptor = _locked(lock, path)
    try:
        yield
    finally:
        with contextlib.suppress(OSError):  # the folder may have become read-only: then it stays
            if _is_at(lock, descriptor):
                lock.unlink()
        os.close(descriptor)


def _locked(lock: Path, path: Path) -> int:
    """Descriptor of the lock's file, locked and with this process's id in it."""
    while True:
        try:
            descriptor = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        except OSError as error:
            raise _no_lock(lock, error) from None
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if _is_at(lock, descriptor):
                _write_id(descriptor)
                return descriptor
        except BlockingIOError:
            holder = os.read(descriptor, LONGEST_ID).decode("ascii", "replace").strip()
            os.close(descriptor)
            raise UserError(
                str(path),
                f"is in use by {f'process {holder}' if holder else 'another process'}",
                "stop that one first, or give each its own file",
            ) from None
        except OSError as error:
            os.close(descriptor)
            raise _no_lock(lock, error) from None
        os.close(descriptor)  # its owner removed it meanwhile


def _is_at(lock: Path, descriptor: int) -> bool:
    """Whether the open file is the one that is there now."""
    try:
        return os.path.samestat(lock.stat(), os.fstat(descriptor))
    except FileNotFoundError:
        return False


def _write_id(descriptor: int) -> None:
    with contextlib.suppress(OSError):  # a full disk: locked all the same, if by nobody known
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, str(os.getpid()).encode(), 0)


def _no_lock(lock: Path, error: OSError) -> UserError:
    return UserError(
        str(lock), f"cannot be locked: {error.strerror}", "check its rights, or name a file on a local disk"
    )
