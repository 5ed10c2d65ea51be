"""First process inside user-mode Linux: brings vcan0 up, runs one command, reports its exit code, powers off.

Started by `uml.py` with one argument, the job file (JSON). Three serial lines lead back to the host:
ttyS0 and ttyS1 carry the command's output and errors, ttyS2 carries signal numbers in and the exit code out.
"""

from __future__ import annotations

import ctypes
import fcntl
import json
import lzma
import os
import signal
import struct
import subprocess
import sys
import termios
import threading
import traceback
import tty
from pathlib import Path
from typing import Any

LIBC = ctypes.CDLL(None, use_errno=True)
INIT_MODULE = 175  # system call number on x86-64, the only architecture user-mode Linux is built for
POWER_OFF = 0x4321FEDC  # LINUX_REBOOT_CMD_POWER_OFF
RECEIVE_BUFFER_MAX = 64 << 20  # bytes a socket may ask for: the command may lack the right to force more
DRAIN_S = 2.0  # how long background processes may go on writing after the command has ended


def mount(kind: str, target: str) -> None:
    """Mount a virtual file system of this kind; raises OSError."""
    if LIBC.mount(kind.encode(), target.encode(), kind.encode(), 0, None) != 0:
        raise OSError(ctypes.get_errno(), f"cannot mount {kind} on {target}")


def load_module(path: Path) -> None:
    """Load one kernel module file (.ko or .ko.xz) without kmod; raises OSError."""
    image = path.read_bytes()
    if path.suffix == ".xz":
        image = lzma.decompress(image)
    if LIBC.syscall(INIT_MODULE, image, ctypes.c_ulong(len(image)), b"") != 0:
        raise OSError(ctypes.get_errno(), f"cannot load {path.name}")


def prepare_system(modules: list[str]) -> None:
    """Mount /proc, /sys and /dev, load the CAN modules, bring lo and vcan0 up with room for receive buffers."""
    mount("proc", "/proc")
    mount("sysfs", "/sys")
    if not Path("/dev").is_mount():  # most kernels mount it themselves
        mount("devtmpfs", "/dev")
    for link, target in (("fd", "self/fd"), ("stdin", "self/fd/0"), ("stdout", "self/fd/1"), ("stderr", "self/fd/2")):
        Path("/dev", link).symlink_to(Path("/proc", target))
    for folder, kind in (("/dev/shm", "tmpfs"), ("/dev/pts", "devpts")):
        Path(folder).mkdir()
        mount(kind, folder)
    Path("/dev/shm").chmod(0o1777)
    for module in modules:
        load_module(Path(module))
    Path("/proc/sys/net/core/rmem_max").write_text(str(RECEIVE_BUFFER_MAX))
    for arguments in ("link set lo up", "link add dev vcan0 type vcan", "link set vcan0 mtu 72 txqueuelen 1000 up"):
        subprocess.run(["ip", *arguments.split()], check=True, env={"PATH": "/usr/sbin:/usr/bin:/sbin:/bin"})


def open_line(number: int) -> int:
    """Open serial line `number` as a transparent byte pipe."""
    line = os.open(f"/dev/ttyS{number}", os.O_RDWR | os.O_NOCTTY)
    tty.setraw(line)
    return line


def pump(source: int, line: int) -> None:
    """Copy a pipe to a serial line until the pipe's last writer has closed it."""
    while chunk := os.read(source, 65536):
        while chunk:
            chunk = chunk[os.write(line, chunk) :]


def forward_signals(control: int, process: subprocess.Popen[bytes]) -> None:
    """Deliver each signal number (one byte) of the host to the command's process group, until the host side dies."""
    try:
        while numbers := os.read(control, 1):
            os.killpg(process.pid, numbers[0])
    except OSError:
        pass
    os.killpg(process.pid, signal.SIGKILL)


def wait_for(process: subprocess.Popen[bytes]) -> int:
    """Reap every orphan until the command itself ends; its exit code, 128 + signal if it was killed."""
    while True:
        pid, status = os.wait()
        if pid == process.pid:
            process.returncode = os.waitstatus_to_exitcode(status)
            return process.returncode if process.returncode >= 0 else 128 - process.returncode


def run(job: dict[str, Any], lines: list[int], control: int) -> int:
    """Run the job's command as the host's user in the host's folder; its exit code as a shell reports it."""
    sinks, pumps = [], []
    for line, window in zip(lines, job["windows"], strict=False):
        if window:  # the host's end is a terminal: so is ours
            fcntl.ioctl(line, termios.TIOCSWINSZ, struct.pack("HHHH", *window, 0, 0))
            sinks.append(line)
        else:
            source, sink = os.pipe()
            pumps.append(threading.Thread(target=pump, args=(source, line), daemon=True))
            sinks.append(sink)
    try:
        process = subprocess.Popen(
            job["command"],
            stdin=subprocess.DEVNULL,
            stdout=sinks[0],
            stderr=sinks[1],
            cwd=job["folder"],
            env=job["environment"],
            user=job["user"],
            group=job["group"],
            extra_groups=job["groups"],
            umask=job["umask"],
            start_new_session=True,
        )
    except OSError as error:
        os.write(lines[1], f"vcan: cannot run {job['command'][0]}: {error.strerror}\n".encode())
        return 127 if isinstance(error, FileNotFoundError) else 126
    for sink in set(sinks) - set(lines):
        os.close(sink)
    for thread in pumps:
        thread.start()
    threading.Thread(target=forward_signals, args=(control, process), daemon=True).start()
    code = wait_for(process)
    for thread in pumps:
        thread.join(DRAIN_S)
    return code


def main() -> None:
    """Run the job named on the command line; failures before it starts go to the kernel's log on the host."""
    try:
        job = json.loads(Path(sys.argv[1]).read_text())
        prepare_system(job["modules"])
        lines, control = [open_line(0), open_line(1)], open_line(2)
        code = run(job, lines, control)
        for line in lines:
            termios.tcdrain(line)
        os.sync()
        os.write(control, f"{code}\n".encode())
        termios.tcdrain(control)
    except Exception:
        for row in traceback.format_exc().splitlines():
            Path("/dev/kmsg").write_text(f"vcan: {row}\n")
    finally:
        os.sync()
        LIBC.reboot(POWER_OFF)


main()
