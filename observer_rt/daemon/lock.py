"""The lock beside a file, by which one process alone writes it."""

import contextlib
import errno
import fcntl
import os
from collections.abc import Iterator, Mapping
from pathlib import Path

from observer_rt.foundation.errors import REMEDY, RunError, UserError
from observer_rt.foundation.files import is_at

LONGEST_ID = 20  # digits of a process id


@contextlib.contextmanager
def sole_writer(path: Path) -> Iterator[None]:
    """Be the only process that writes the file at `path`, by a lock on `NAME.lock` beside it.

    The lock ends with its process however that ends; the file left behind by a killed one is in nobody's way. Raises
    `UserError` where another process writes it, or no lock can be made, `RunError` where a stranger has the lock.
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
    was_replaced = False
    while True:
        try:
            descriptor = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        except OSError as error:
            raise _no_lock(lock, error) from None
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.pread(descriptor, LONGEST_ID, 0).strip(b"0123456789"):
                raise FileExistsError(errno.EEXIST, "it holds something else than the id of a process")
            if is_at(lock, file := os.fstat(descriptor)):
                if was_replaced or (file.st_uid == os.geteuid() and not file.st_mode & 0o077):
                    with contextlib.suppress(OSError):  # a full disk: locked all the same, if by nobody known
                        os.ftruncate(descriptor, 0)
                        os.pwrite(descriptor, str(os.getpid()).encode(), 0)
                    return descriptor
                # Of an earlier version or another user: who waits for this file's lock does not get the next one's.
                # Once only, for not every file system keeps owners and rights.
                was_replaced = True
                with contextlib.suppress(OSError):
                    lock.unlink()
        except BlockingIOError:
            writer = os.read(descriptor, LONGEST_ID).decode("ascii", "replace").strip()
            in_use = _in_use(path, lock, writer, _holder(os.fstat(descriptor)))
            os.close(descriptor)
            raise in_use from None
        except OSError as error:
            os.close(descriptor)
            raise _no_lock(lock, error) from None
        os.close(descriptor)  # its owner removed it meanwhile


def _holder(file: os.stat_result) -> dict[str, str]:
    """What the kernel tells of the process that has the lock of a file; empty where it tells nothing."""
    locked = f"{os.major(file.st_dev):02x}:{os.minor(file.st_dev):02x}:{file.st_ino}"
    with contextlib.suppress(OSError):
        for line in Path("/proc/locks").read_text("ascii").splitlines():
            _, kind, _, _, process, file_at, *_ = line.split()
            if (kind, file_at) == ("FLOCK", locked):
                status = Path(f"/proc/{process}/status").read_text("utf-8", "replace")
                return dict(row.split(":\t", 1) for row in status.splitlines() if ":\t" in row)
    return {}


def _in_use(path: Path, lock: Path, writer: str, holder: Mapping[str, str]) -> UserError | RunError:
    """Error for a lock that another process has; writer: the process that its file names, as its container counts."""
    if holder and writer and writer not in holder["NSpid"].split():
        process = f"process {holder['Pid']} ({holder['Name']}) of user id {holder['Uid'].split()[0]}"
        problem = f"its lock is held by {process}, not by process {writer}, whose lock it was"
        return RunError(f"{path}: {problem}{REMEDY}stop that process, or remove {lock}")
    problem, remedy = f"is in use by {f'process {writer}' if writer else 'another process'}", "give each its own file"
    if not holder and writer and not Path("/proc", writer).exists():
        problem, remedy = f"{problem} of another container or not seen from here", f"remove {lock} if it has ended"
    return UserError(str(path), problem, f"stop that one first, or {remedy}")


def _no_lock(lock: Path, error: OSError) -> UserError:
    problem, remedy = f"cannot be locked: {error.strerror}", "check its rights, or name a file on a local disk"
    if isinstance(error, PermissionError) and lock.exists() and (owner := lock.stat().st_uid) != os.geteuid():
        remedy = f"run it as user id {owner}, whose file it is, or remove that one if no daemon of that user runs"
    return UserError(str(lock), problem, remedy)
