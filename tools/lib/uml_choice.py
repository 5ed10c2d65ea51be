"""Chooses a user-mode Linux kernel that boots on this machine, fetching one into a per-user cache if need be."""

from __future__ import annotations

import fcntl
import hashlib
import os
import shutil
import sys
from pathlib import Path

from say import KernelError, UnableError, say
from uml import run_in_uml
from uml_kernel import Kernel, kernel_below
from uml_package import PACKAGE, unpack_distribution, unpack_newest

# In order of preference. The newest intercepts system calls by seccomp, which is ten times faster than ptrace, and it
# runs on CPUs with AMX, whose registers are more than kernels before 6.13 can hand to ptrace.
UNPACKERS = {"newest": unpack_newest, "distribution": unpack_distribution}
TRIAL_S = 120.0
BOOTS = "boots\n"


def obtain_kernel(system: Path = Path("/")) -> Kernel:
    """The first kernel that boots of those fetched earlier, the one installed below `system`, those to be had.

    Several callers at once take turns. Raises UnableError.
    """
    cache = cache_folder()
    failures: list[KernelError] = []
    with (cache / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        missing = [cache / name for name in UNPACKERS if not (cache / name).exists()]
        fetched = [cache / name for name in UNPACKERS if cache / name not in missing]
        for root in (*fetched, system, *missing):
            try:
                if root in missing:
                    fetch_into(root)
                kernel = kernel_below(root)
                if kernel is not None:
                    require_boot(kernel, cache / "trials")
                    return kernel
            except KernelError as error:
                failures.append(error)
    problems = ["no user-mode Linux to be had that boots here", *map(str, failures)]
    mend = failures[0].mend if failures else "sudo modprobe vcan"
    raise UnableError("\n  ".join(problems), mend, "".join(error.details for error in failures))


def cache_folder() -> Path:
    """Folder for unpacked kernels and notes on them; raises UnableError."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    folder = Path(base) / "observer_rt_tools" / PACKAGE
    try:
        (folder / "trials").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        remedy = "export XDG_CACHE_HOME=FOLDER_YOU_MAY_WRITE"
        raise UnableError(f"cannot make {folder}: {error.strerror}", remedy) from error
    return folder


def fetch_into(target: Path) -> None:
    """Download and unpack the kernel with the name of the folder `target`; raises KernelError."""
    if shutil.which("apt-get") is None or shutil.which("dpkg-deb") is None:
        problem = "user-mode Linux comes as a Debian package, and this machine has no apt-get"
        raise KernelError(problem, "sudo modprobe vcan")
    folder = target.with_suffix(".partial")
    shutil.rmtree(folder, ignore_errors=True)  # left by a download that was killed
    folder.mkdir()
    say(f"downloading Debian package {PACKAGE}, {target.name} (about 50 MB)")
    try:
        root = UNPACKERS[target.name](folder)
        if kernel_below(root) is None:
            raise KernelError(f"{PACKAGE}, {target.name}: it lacks CAN modules", "sudo modprobe vcan")
        root.rename(target)
        say(f"unpacked into {target}")
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def require_boot(kernel: Kernel, trials: Path) -> None:
    """Raise KernelError unless the kernel boots, which is tried once for a kernel and machine, and remembered."""
    status = kernel.program.stat()
    flags = next((x for x in Path("/proc/cpuinfo").read_text().splitlines() if x.startswith("flags")), "")
    key = f"{kernel.program} {status.st_size} {status.st_mtime_ns} {os.uname().release} {flags}"
    trial = trials / hashlib.sha256(key.encode()).hexdigest()[:16]
    if not trial.exists():
        new = trial.with_suffix(".new")
        new.write_text(messages_of_trial(kernel))
        new.rename(trial)
        if trial.read_text() != BOOTS:
            say(f"{kernel.program} does not boot on this machine; looking for another")
    messages = trial.read_text()
    if messages != BOOTS:
        raise KernelError(f"{kernel.program}: {reason_in(messages)}", f"rm {trial}, to try it anew")


def messages_of_trial(kernel: Kernel) -> str:
    """`BOOTS` if an empty command runs in this kernel, else the messages of the boot."""
    try:
        code = run_in_uml(kernel, ["/bin/sh", "-c", ":"], TRIAL_S)
    except KernelError as error:
        return error.details
    if code > 128:  # we were told to stop
        sys.exit(code)
    return BOOTS if code == 0 else f"failed with exit code {code}\n"


def reason_in(messages: str) -> str:
    """The line of a boot's messages that says why it failed."""
    lines = [line.strip() for line in messages.splitlines() if line.strip()]
    telling = (line for line in lines if "errno" in line or "panic" in line)
    return next(telling, lines[-1] if lines else "it said nothing")
