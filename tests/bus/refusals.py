"""How often, and why, the kernel refused to take a frame: noted beside the links under test."""

import errno
import socket
from collections import Counter
from typing import Any

import pytest


def note_refusals(monkeypatch: pytest.MonkeyPatch, send_buffer: int | None = None) -> Counter[str]:
    """Names of the errors with which sending fails from now on, and how often.

    send_buffer: of the sockets made from now on, in bytes (the kernel raises it to its least); None: the usual.
    """
    refusals: Counter[str] = Counter()

    class Noting(socket.socket):
        def bind(self, address: Any) -> None:
            super().bind(address)
            if send_buffer is not None:
                self.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, send_buffer)

        def send(self, data: bytes, flags: int = 0) -> int:  # type: ignore[override]
            try:
                return super().send(data, flags)
            except OSError as error:
                refusals[errno.errorcode[error.errno or 0]] += 1
                raise

    monkeypatch.setattr(socket, "socket", Noting)
    return refusals
