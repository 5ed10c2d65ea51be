"""The lock beside a file, by which one process alone writes it."""

import contextlib
import errno
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import is_at

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
            if is_at(lock, os.fstat(descriptor)):
                lock.unlink()
        os.close(descriptor)


def is_written(path: Path) -> bool:
    """Whether some process is the sole writer of a file, in whichever container, or this cannot be found out."""
    try:
        descriptor = os.open(os.path.realpath(path) + ".lock", os.O_RDONLY | os.O_CLOEXEC)
    except OSError as error:
        return isinstance(error, PermissionError)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(descriptor)
    return False


def _locked(lock: Path, path: Path) -> int:
    """Descriptor of the lock's file, locked and with this process's id in it."""
    while True:
        try:
            descriptor = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        except OSError as error:
            raise _no_lock(lock, error) from None
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.pread(descriptor, LONGEST_ID, 0).strip(b"0123456789"):
                raise FileExistsError(errno.EEXIST, "it holds something else than the id of a process")
            if is_at(lock, os.fstat(descriptor)):
                with contextlib.suppress(OSError):  # a full disk: locked all the same, if by nobody known
                    os.ftruncate(descriptor, 0)
                    os.pwrite(descriptor, str(os.getpid()).encode(), 0)
                return descriptor
        except BlockingIOError:
            holder = os.read(descriptor, LONGEST_ID).decode("ascii", "replace").strip()
            os.close(descriptor)
            problem = f"is in use by {f'process {holder}' if holder else 'another process'}"
            raise UserError(str(path), problem, "stop that one first, or give each its own file") from None
        except OSError as error:
            os.close(descriptor)
            raise _no_lock(lock, error) from None
        os.close(descriptor)  # its owner removed it meanwhile


def _no_lock(lock: Path, error: OSError) -> UserError:
    problem = f"cannot be locked: {error.strerror}"
    return UserError(str(lock), problem, "check its rights, or name a file on a local disk")
