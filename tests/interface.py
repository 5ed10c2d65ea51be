"""A virtual CAN interface of a test's own, to be taken down, away and back."""

import contextlib
import json
import subprocess
from collections.abc import Iterator

import pytest

FRAME_BYTES = 72  # of a CAN FD frame, whatever it carries


class OwnInterface:
    """Made by `ip`, which needs the right to change interfaces; tools/vcan grants it to the superuser."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.add()

    def add(self) -> None:
        self._ip("link", "add", "dev", self.name, "type", "vcan")
        self._ip("link", "set", self.name, "mtu", "72", "up")

    def down(self) -> None:
        self._ip("link", "set", self.name, "down")

    def up(self) -> None:
        self._ip("link", "set", self.name, "up")

    def remove(self) -> None:
        self._ip("link", "delete", self.name)

    def slow_down(self, bytes_per_s: int, queue_bytes: int) -> None:
        """Let frames leave at this rate; beyond a queue the kernel refuses them; a CAN FD frame is FRAME_BYTES."""
        shape = f"tbf rate {8 * bytes_per_s}bit burst {2 * FRAME_BYTES} limit {queue_bytes}"
        _run("tc", "qdisc", "replace", "dev", self.name, "root", *shape.split())

    @property
    def refused(self) -> int:
        """Frames that a slow interface's queue had no room for, whoever sent them."""
        (queue,) = json.loads(_run("tc", "-s", "-j", "qdisc", "show", "dev", self.name))
        return int(queue["drops"])

    def _ip(self, *arguments: str) -> None:
        _run("ip", *arguments)


@contextlib.contextmanager
def own_interfaces(*names: str) -> Iterator[list[OwnInterface]]:
    """Away at the end, whatever the test did to them."""
    made = [OwnInterface(name) for name in names]
    try:
        yield made
    finally:
        for interface in made:
            with contextlib.suppress(pytest.fail.Exception):  # where the test took it away
                interface.remove()


def _run(*command: str) -> str:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.fail(f"{' '.join(command)}: {done.stderr}; run as the superuser", pytrace=False)
    return done.stdout
