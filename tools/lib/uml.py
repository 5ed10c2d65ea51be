"""Runs one command in user-mode Linux: the host's files, user and environment, and a vcan0 of its own."""

from __future__ import annotations

import contextlib
import json
import os
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from say import KernelError, UnableError
from supervise import supervise
from uml_kernel import Kernel

GUEST = Path(__file__).with_name("uml_guest.py")
WANTED_MIB, LEAST_MIB = 3072, 512


def free_memory_mib() -> int:
    """Memory this process may still take, MiB: the machine's, or less where a container limits it."""
    fields = dict(line.split(":", 1) for line in Path("/proc/meminfo").read_text().splitlines())
    free = int(fields["MemAvailable"].split()[0]) // 1024
    try:
        limit = int(Path("/sys/fs/cgroup/memory.max").read_text())
        used = int(Path("/sys/fs/cgroup/memory.current").read_text())
    except (OSError, ValueError):  # no such cgroup, or "max"
        return free
    return min(free, (limit - used) >> 20)


def memory_size_mib() -> int:
    """Size of the guest's memory: 3 GiB, or two thirds of the free memory where that is less."""
    size = min(WANTED_MIB, free_memory_mib() * 2 // 3)
    if size < LEAST_MIB:
        raise UnableError(f"user-mode Linux needs {LEAST_MIB * 3 // 2} MiB of free memory", "close other programs")
    return size


def memory_folder(size_mib: int) -> str:
    """Folder for the file that backs the guest's memory: it is mapped executable, so not on `noexec`."""
    candidates = ["/dev/shm", tempfile.gettempdir(), "/var/tmp", str(Path.home())]
    for folder in candidates:
        with contextlib.suppress(OSError):
            status = os.statvfs(folder)
            room_mib = status.f_bavail * status.f_frsize >> 20
            if room_mib > size_mib and not status.f_flag & os.ST_NOEXEC and os.access(folder, os.W_OK):
                return folder
    problem = f"no folder of {', '.join(candidates)} has {size_mib} MiB free"
    raise UnableError(problem, "export TMPDIR=FOLDER_WITH_ROOM")


def run_in_uml(kernel: Kernel, command: list[str], timeout_s: float) -> int:
    """Exit code of `command`, run in one boot of `kernel`; raises KernelError if the guest fails."""
    size_mib = memory_size_mib()
    with tempfile.TemporaryDirectory(prefix="vcan-") as name, contextlib.ExitStack() as pipes:
        folder = Path(name)
        write_job(folder, kernel, command)
        out, errors, orders, answers = (Pipe(pipes) for _ in range(4))
        process = boot(kernel, folder, size_mib, (out.sink, errors.sink, orders.source, answers.sink))
        for end in (out.sink, errors.sink, orders.source, answers.sink):
            end.close()

        def deliver(number: int) -> None:
            orders.sink.write(bytes([number]))

        pumps = [threading.Thread(target=pump, args=(p.source, n, deliver)) for p, n in ((out, 1), (errors, 2))]
        for thread in pumps:
            thread.start()
        killed = supervise(process, deliver, timeout_s, folder)
        for thread in pumps:
            thread.join()
        answer = answers.source.read()
        if answer:
            return int(answer)
        if killed is not None:
            return killed
        messages = (folder / "boot").read_text(errors="replace")
    problem = "user-mode Linux ended before the command did (its messages are above)"
    raise KernelError(problem, "sudo modprobe vcan", messages)


class Pipe:
    """A pipe's two ends as unbuffered files."""

    def __init__(self, owner: contextlib.ExitStack) -> None:
        source, sink = os.pipe()
        self.source = owner.enter_context(os.fdopen(source, "rb", buffering=0))
        self.sink = owner.enter_context(os.fdopen(sink, "wb", buffering=0))


def boot(
    kernel: Kernel, folder: Path, size_mib: int, lines: tuple[BinaryIO, BinaryIO, BinaryIO, BinaryIO]
) -> subprocess.Popen[bytes]:
    """Start the kernel; `lines` are the guest's ends for output, errors, signals in and exit code out."""
    out, errors, orders, answers = (line.fileno() for line in lines)
    arguments = [
        *("root=/dev/root", "rootfstype=hostfs", "rootflags=/", "rw", f"init={folder}/init", f"mem={size_mib}M"),
        "seccomp=auto",  # where both it and the host can; kernels before 6.16 pay no attention
        *(f"uml_dir={folder}/", "con=null", "con0=null,fd:1", f"ssl0=null,fd:{out}", f"ssl1=null,fd:{errors}"),
        f"ssl2=fd:{orders},fd:{answers}",
    ]
    environment = {"PATH": os.defpath, "HOME": str(folder), "TMPDIR": memory_folder(size_mib)}
    if kernel.libraries is not None:
        environment["LD_LIBRARY_PATH"] = str(kernel.libraries)
    with (folder / "boot").open("wb") as log:
        return subprocess.Popen(
            [kernel.program, *arguments],
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            env=environment,
            cwd=kernel.libraries,
            pass_fds=(out, errors, orders, answers),
            start_new_session=True,
        )


def write_job(folder: Path, kernel: Kernel, command: list[str]) -> None:
    """Write what the guest reads: its init script and the command with everything it inherits from us."""
    umask = os.umask(0)
    os.umask(umask)
    job = {
        "command": command,
        "folder": str(Path.cwd()),
        "environment": dict(os.environ),
        "user": os.getuid(),
        "group": os.getgid(),
        "groups": os.getgroups(),
        "umask": umask,
        "modules": [str(path) for path in kernel.modules],
        "windows": [window_of(1), window_of(2)],
    }
    (folder / "job.json").write_text(json.dumps(job))
    words = [sys.executable, "-I", "-S", str(GUEST), f"{folder}/job.json"]
    (folder / "init").write_text(f"#!/bin/sh\nexec {shlex.join(words)}\n")
    (folder / "init").chmod(0o700)


def pump(source: BinaryIO, sink: int, deliver: Callable[[int], None]) -> None:
    """Copy a pipe to our descriptor `sink` until its last writer has closed it.

    When the reader of `sink` goes away, `deliver` signals the command, as a plain pipe would.
    """
    broken = False
    while chunk := source.read(65536):
        while chunk and not broken:
            try:
                chunk = chunk[os.write(sink, chunk) :]
            except OSError:
                broken = True
                with contextlib.suppress(OSError):
                    deliver(signal.SIGPIPE)


def window_of(descriptor: int) -> tuple[int, int] | None:
    """(rows, columns) if the descriptor is a terminal."""
    if not os.isatty(descriptor):
        return None
    size = shutil.get_terminal_size()
    return size.lines, size.columns
