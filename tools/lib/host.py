"""vcan0 on the host itself: is it there, can it be made, make it."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

from say import UnableError, say
from supervise import supervise

INTERFACE = Path("/sys/class/net/vcan0")
CAN_FD_MTU = 72
FLAG_UP = 1
SYSTEM_FOLDERS = "/usr/local/sbin:/usr/sbin:/sbin"  # where `ip` is; a user's PATH may lack them


def interface_ready() -> bool:
    """True if vcan0 is up and carries CAN FD frames."""
    try:
        flags = int((INTERFACE / "flags").read_text(), 16)
        mtu = int((INTERFACE / "mtu").read_text())
    except OSError:
        return False
    return bool(flags & FLAG_UP) and mtu >= CAN_FD_MTU


def administrator() -> list[str] | None:
    """Words to put before a command so that it runs with root's rights; None without them."""
    if os.geteuid() == 0:
        return []
    words = ["sudo", "-n"]
    return words if shutil.which("sudo") and quietly([*words, "true"]) else None


def quietly(command: list[str]) -> bool:
    """Run a command whose output does not matter; True if it succeeded."""
    return subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False).returncode == 0


def ip_program() -> str | None:
    """Path of iproute2's `ip`, if it is installed."""
    return shutil.which("ip", path=f"{os.environ.get('PATH', os.defpath)}:{SYSTEM_FOLDERS}")


def obtain_ip() -> str:
    """Path of `ip`, installed first where rights allow; raises UnableError."""
    program = ip_program()
    if program is not None:
        return program
    words = administrator()
    if words is not None and shutil.which("apt-get"):
        say("installing Debian package iproute2")
        for arguments in (["update"], ["install", "-y", "--no-install-recommends", "iproute2"]):
            command = [*words, "apt-get", "-qq", *arguments]
            subprocess.run(command, stdin=subprocess.DEVNULL, stdout=2, check=False)
        program = ip_program()
    if program is None:
        raise UnableError("the command `ip` is missing", "sudo apt-get update && sudo apt-get install -y iproute2")
    return program


def interface_possible() -> bool:
    """True if this kernel makes vcan interfaces and we may ask it to: tried in a network of its own."""
    words, program = administrator(), ip_program()
    if words is None or program is None or shutil.which("unshare") is None:
        return False
    # Asking for the interface also loads the module, where one is installed.
    trial = [*words, "unshare", "--net", program, "link", "add", "dev", "vcan0", "type", "vcan"]
    return quietly(trial)


def create_interface() -> bool:
    """Bring vcan0 up on the host, where it stays: another command may be using it by then. True if it is up."""
    words, program = administrator(), obtain_ip()
    assert words is not None
    if not INTERFACE.exists():
        quietly([*words, program, "link", "add", "dev", "vcan0", "type", "vcan"])
    for arguments in ("down", "mtu 72 txqueuelen 1000 up"):
        quietly([*words, program, "link", "set", "vcan0", *arguments.split()])
    ready = interface_ready()
    say("made vcan0 on the host; `ip link del vcan0` removes it" if ready else "the host refuses a vcan0")
    return ready


def run_on_host(command: list[str], timeout_s: float) -> int:
    """Exit code of `command`, as a shell reports it."""
    try:
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, start_new_session=True)
    except OSError as error:
        say(f"cannot run {command[0]}: {error.strerror}")
        return 127 if isinstance(error, FileNotFoundError) else 126
    killed = supervise(process, lambda number: os.killpg(process.pid, number), timeout_s)
    if killed is not None:
        return killed
    return process.returncode if process.returncode >= 0 else 128 - process.returncode
