"""A link over any python-can interface: vendor hardware, or `virtual` within one process."""

import contextlib
import os
import socket
import threading
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import can

from observer_rt.bus.links.controller import BusCondition
from observer_rt.bus.links.link import SWITCHED, FdFlags, Frame, Link, LinkDownError, StampSource
from observer_rt.bus.links.receive_buffer import LostFrames, lost_by, size_receive_buffer
from observer_rt.foundation.errors import RunError, UserError

SEND_TIMEOUT_S = 0.5  # how long a driver may wait for a place in its queue
_IP_MULTICAST_ALL, _IPV6_MULTICAST_ALL = 49, 29  # of linux/in.h and linux/in6.h, which Python does not name
DATAGRAM_BYTES = 1280  # about what a frame of 64 bytes takes of the receive buffer as a datagram

MOST_OWN = 4096  # frames remembered as sent: about a second of results


class OwnFrames:
    """Frames sent lately, by which those that an interface gives back to their sender are recognised."""

    def __init__(self) -> None:
        self._sent: dict[tuple[int, bool, bytes], int] = {}  # how often, the oldest first

    def note(self, frame_id: int, is_extended: bool, payload: bytes) -> None:
        """Remember a frame that is being sent."""
        key = frame_id, is_extended, payload
        self._sent[key] = self._sent.pop(key, 0) + 1
        if len(self._sent) > MOST_OWN:
            del self._sent[next(iter(self._sent))]

    def forget(self, frame_id: int, is_extended: bool, payload: bytes) -> bool:
        """Forget one sending of a frame, which came back or failed; False: no such frame is remembered."""
        key = frame_id, is_extended, payload
        left = self._sent.pop(key, 0) - 1
        if left > 0:
            self._sent[key] = left
        return left >= 0


class PythonCanLink(Link):
    """Link over a bus of python-can, whose stamps are float seconds: 0.24 us at best."""

    def __init__(
        self,
        interface: str,
        channel: str,
        fd: bool,
        receive_ids: Sequence[tuple[int, bool]] | None,
        computer_time: bool = False,
        bit_rates: Sequence[float] = (),
    ) -> None:
        self._interface, self._fd = interface, fd
        self._name = f"{interface} channel {channel}"
        # some drivers want a number
        self._options: dict[str, Any] = {"channel": int(channel) if channel.isdecimal() else channel}
        self._options |= zip(("bitrate", "data_bitrate"), map(round, bit_rates), strict=False)
        self._receive_ids = None if receive_ids is None else frozenset(receive_ids)
        self._reads = self._receive_ids is None or bool(receive_ids)  # else nothing that comes is lost
        self._by_arrival = computer_time or interface == "virtual"
        self._computer_time = computer_time
        self._condition = BusCondition()
        self._own = OwnFrames()
        self._lost = LostFrames()
        self._receiver: socket.socket | None = None
        self._warnings: list[str] = []
        self._sending = threading.Lock()  # drivers need not be safe for several threads
        self._open()

    def _open(self) -> None:
        try:
            # without files and variables of the user's other programs
            self._bus = can.Bus(interface=self._interface, ignore_config=True, fd=self._fd, **self._options)
            if self._interface == "udp_multicast":
                self._receiver = socket.socket(fileno=os.dup(self._bus.fileno()))
                self._prepare(self._receiver)
        except (can.CanInterfaceNotImplementedError, ImportError, NameError) as error:  # waiting does not mend it
            remedy = "install its driver, or use another interface"
            problem = f"{self._interface!r} cannot be used on this computer: {error}"
            raise UserError("link.interface", problem, remedy) from error
        except (can.CanError, OSError, ValueError, TypeError) as error:
            raise LinkDownError(
                f"{self._name} cannot be opened: {error}\n"
                "  remedy: check that the device is connected, its driver installed and the channel correct"
            ) from error

    def _prepare(self, receiver: socket.socket) -> None:
        """Have it get frames of its own multicast group only, not of all that programs on this computer joined."""
        receiver.setsockopt(socket.IPPROTO_IP, _IP_MULTICAST_ALL, 0)
        if receiver.family == socket.AF_INET6:
            receiver.setsockopt(socket.IPPROTO_IPV6, _IPV6_MULTICAST_ALL, 0)
        if self._reads:
            self._warnings = size_receive_buffer(receiver, self._name, DATAGRAM_BYTES)
        while self._bus.recv(0.0) is not None:
            pass  # came before
        self._lost.begin(lost_by(receiver))

    def receive(self, timeout_s: float) -> Frame | None:
        deadline = time.monotonic() + timeout_s
        while True:  # Frames are chosen here: python-can's recv(0) may report "none" for an unwanted frame.
            try:
                message = self._bus.recv(max(0.0, deadline - time.monotonic()))
            except (can.CanError, OSError) as error:
                raise LinkDownError(
                    f"{self._name} failed while receiving: {error}\n  remedy: check that the device is connected"
                ) from error
            if message is None:
                return None
            if self._receiver is not None and self._reads:
                self._lost.note(lost_by(self._receiver))
            if message.is_error_frame:
                self._condition = replace(self._condition, error_frames=self._condition.error_frames + 1)
                continue
            if message.is_remote_frame:
                continue
            key = (message.arbitration_id, message.is_extended_id)
            if self._own.forget(*key, bytes(message.data)):
                continue
            if self._receive_ids is None or key in self._receive_ids:
                stamp_ns = 0 if self._computer_time else round(message.timestamp * 1e9)
                return Frame(
                    message.arbitration_id,
                    bytes(message.data),
                    stamp_ns or time.time_ns(),  # not every driver has stamps
                    message.is_extended_id,
                    message.is_fd,
                    message.is_fd and message.bitrate_switch,
                    message.is_fd and message.error_state_indicator,
                )

    def send(self, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool, flags: FdFlags = SWITCHED) -> None:
        try:
            self._send(frame_id, payload, is_extended, is_fd, flags, SEND_TIMEOUT_S)
        except (can.CanError, OSError) as error:
            raise RunError(
                f"{self._name} cannot send: {error}\n"
                "  remedy: check that another node is on the bus and the bit rates agree"
            ) from error

    def try_send(self, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool) -> bool:
        """Whether the driver took it. Causes other than a full queue show when receiving."""
        try:
            self._send(frame_id, payload, is_extended, is_fd, SWITCHED, 0.0)
        except (can.CanError, OSError):  # drivers have errors of their own for a full queue
            return False
        return True

    def _send(
        self, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool, flags: FdFlags, timeout_s: float
    ) -> None:
        message = can.Message(
            arbitration_id=frame_id,
            data=payload,
            is_extended_id=is_extended,
            is_fd=is_fd,
            bitrate_switch=is_fd and flags.bit_rate_switch,
            error_state_indicator=is_fd and flags.error_state_indicator,
            check=True,
        )
        with self._sending:
            self._own.note(frame_id, is_extended, payload)
            try:
                self._bus.send(message, timeout_s)
            except BaseException:
                self._own.forget(frame_id, is_extended, payload)
                raise
            if not self._reads:
                while self._bus.recv(0.0) is not None:
                    pass  # nobody reads a link that only sends, and the virtual bus's queue grows without limit

    def reconnect(self) -> None:
        with self._sending:
            self.close()
            try:
                self._open()
            except UserError as error:  # it could be used before
                raise LinkDownError(str(error)) from error

    @property
    def dropped(self) -> int:
        """Those that the kernel counts; zero for others: python-can counts none, and the virtual bus loses none."""
        return self._lost.count

    @property
    def condition(self) -> BusCondition:
        return self._condition

    @property
    def stamp_source(self) -> StampSource:
        return StampSource.ARRIVAL if self._by_arrival else StampSource.DRIVER

    @property
    def warnings(self) -> Sequence[str]:
        return self._warnings

    def close(self) -> None:
        if self._receiver is not None:
            self._receiver.close()
        with contextlib.suppress(can.CanError, OSError):  # the device may be gone
            self._bus.shutdown()
