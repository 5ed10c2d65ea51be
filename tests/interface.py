"""A virtual CAN interface of a test's own, to be taken down, away and back."""

import subprocess

import pytest


class OwnInterface:
    """Made by `ip`, which needs the right to change interfaces; tools/vcan grants it to the superuser."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.add()

    def add(self) -> None:
        """Plug it in, up and with CAN FD."""
        self._ip("link", "add", "dev", self.name, "type", "vcan")
        self._ip("link", "set", self.name, "mtu", "72", "up")

    def down(self) -> None:
        self._ip("link", "set", self.name, "down")

    def up(self) -> None:
        self._ip("link", "set", self.name, "up")

    def remove(self) -> None:
        """Pull the plug."""
        self._ip("link", "delete", self.name)

    def _ip(self, *arguments: str) -> None:
        done = subprocess.run(["ip", *arguments], capture_output=True, text=True, check=False)
        if done.returncode:
            pytest.fail(f"ip {' '.join(arguments)}: {done.stderr}; run as the superuser", pytrace=False)
