"""A link over a raw SocketCAN socket: one system call a frame, stamps in integer ns since 1970, losses counted."""

import array
import errno
import fcntl
import select
import socket
import struct
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from observer_rt.bus.can_frame import ARPHRD_CAN, BIT_RATE_SWITCH, CLASSIC_LENGTH, ERROR_STATE, FD_LENGTHS, FD_MTU
from observer_rt.bus.links import controller, link
from observer_rt.bus.links.receive_buffer import LostFrames, size_receive_buffer
from observer_rt.foundation.errors import RunError, UserError
from observer_rt.foundation.units import NANOSECONDS

NO_SOCKETCAN = 'sudo modprobe can_raw, or interface = "udp_multicast" in the bench file (docs/buses.md)'
"""Remedy where the kernel has no CAN."""

# Of the generic Linux interface (linux/net_tstamp.h, linux/ethtool.h), not all known to Python's socket module.
SO_TIMESTAMPNS, SO_TIMESTAMPING, SO_RXQ_OVFL = 35, 37, 40
_CAN_RAW_ERR_FILTER, _SIOCGIFMTU = 2, 0x8921
_RX_HARDWARE, _RX_SOFTWARE, _SOFTWARE, _RAW_HARDWARE = 1 << 2, 1 << 3, 1 << 4, 1 << 6
_SIOCETHTOOL = 0x8946
_ETHTOOL_GET_TS_INFO = 0x41
_TIMESPEC = struct.Struct("@ll")
_THREE_TIMESPECS = struct.Struct("@6l")  # by the kernel, unused, by the interface; 0 where there is none
_TS_INFO = struct.Struct("=II36x")  # command, capabilities, the rest of struct ethtool_ts_info
_IFREQ_POINTER = struct.Struct("@16sP16x")

ANCILLARY_BYTES = socket.CMSG_SPACE(_THREE_TIMESPECS.size)

FRAME_BYTES = 768  # about what a received frame takes of the receive buffer
SEND_RETRY_S = 0.5e-3  # about three full frames at 500k/5M
SEND_PATIENCE_S = 0.5

# can_frame: identifier, length, 3 unused, data; canfd_frame: identifier, length, flags, 2 unused, data.
_HEADER = struct.Struct("=IBB2x")
_CLASSIC_FRAME = struct.Struct("=IB3x8s")
_FD_FRAME = struct.Struct("=IBB2x64s")
_FILTER = struct.Struct("=II")
_COUNT = struct.Struct("=I")
_ANCILLARY_BYTES = ANCILLARY_BYTES + socket.CMSG_SPACE(_COUNT.size)
_ERROR_CLASSES = controller.ErrorClass.CONTROLLER | controller.ErrorClass.BUS_OFF | controller.ErrorClass.RESTARTED


class StampReader:
    """Reads the stamps of one socket; those of the interface itself where it offers them.

    An interface's clock starts anywhere: the first frame's offset carries its stamps to the computer's time.
    Distances between stamps stay the interface's, whatever the computer does; the two clocks drift apart.
    """

    def __init__(self, can_socket: socket.socket, channel: str, computer_time: bool = False) -> None:
        """Switch stamps on; computer_time: never those of the interface. Raises OSError."""
        self.by_hardware = not computer_time and _offers_hardware_stamps(can_socket, channel)
        self._offset: int | None = None
        if self.by_hardware:
            wanted = _RX_HARDWARE | _RAW_HARDWARE | _RX_SOFTWARE | _SOFTWARE
            can_socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPING, wanted)
        else:
            can_socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)

    def read(self, kind: int, value: bytes) -> int | None:
        """The stamp [ns since 1970] in a control message of the socket level, None if it holds none."""
        if kind == SO_TIMESTAMPNS:
            seconds, nanoseconds = _TIMESPEC.unpack(value)
            return int(seconds * NANOSECONDS + nanoseconds)
        if kind != SO_TIMESTAMPING:
            return None
        seconds, nanoseconds, _, _, raw_seconds, raw_nanoseconds = _THREE_TIMESPECS.unpack(value)
        by_kernel = int(seconds * NANOSECONDS + nanoseconds) or time.time_ns()
        by_interface = int(raw_seconds * NANOSECONDS + raw_nanoseconds)
        if by_interface == 0:  # such as a frame another program of this computer sent
            return by_kernel
        if self._offset is None:
            self._offset = by_kernel - by_interface
        return by_interface + self._offset


def _offers_hardware_stamps(can_socket: socket.socket, channel: str) -> bool:
    info = array.array("B", _TS_INFO.pack(_ETHTOOL_GET_TS_INFO, 0))
    try:
        fcntl.ioctl(can_socket, _SIOCETHTOOL, _IFREQ_POINTER.pack(channel.encode(), info.buffer_info()[0]))
    except OSError:  # a driver without the question, or no such interface: binding will fail
        return False
    _, capabilities = _TS_INFO.unpack(info)
    needed = _RX_HARDWARE | _RAW_HARDWARE
    return bool(capabilities & needed == needed)


class SocketCanLink(link.Link):
    """Raw socket on one interface, such as `can0` or `vcan0`."""

    def __init__(
        self, channel: str, fd: bool, receive_ids: Sequence[tuple[int, bool]] | None, computer_time: bool = False
    ) -> None:
        if not hasattr(socket, "AF_CAN"):
            raise UserError("link.interface", "socketcan needs Linux", "use another python-can interface")
        self._channel = channel
        self._fd = fd
        self._receive_ids = receive_ids
        self._computer_time = computer_time
        self._lost = LostFrames()
        self._condition = controller.BusCondition()
        self._warnings: list[str] = []
        self._open()

    def _open(self) -> None:
        self._connect()
        self._lost.begin()
        self._readable = select.poll()
        self._readable.register(self._socket, select.POLLIN)

    def _connect(self) -> None:
        try:
            self._socket = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        except OSError as error:
            raise RunError(f"the kernel offers no SocketCAN: {error.strerror}\n  remedy: {NO_SOCKETCAN}") from error
        try:
            self._configure()
        except OSError as error:
            self._socket.close()
            raise self.failure(error) from error
        except RunError:
            self._socket.close()
            raise

    def _configure(self) -> None:
        if self._fd:
            self._require_fd_mtu()
            self._socket.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
        self._socket.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, _filters(self._receive_ids))
        if self._receive_ids is None or self._receive_ids:  # else nobody would ever read them
            self._socket.setsockopt(socket.SOL_CAN_RAW, _CAN_RAW_ERR_FILTER, int(_ERROR_CLASSES))
            self._warnings = size_receive_buffer(self._socket, self._channel, FRAME_BYTES)
        self._socket.setsockopt(socket.SOL_SOCKET, SO_RXQ_OVFL, 1)
        self._stamps = StampReader(self._socket, self._channel, self._computer_time)
        self._socket.bind((self._channel,))
        self._socket.setblocking(False)
        pending = self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if pending:  # binding to an interface that is down succeeds
            raise OSError(pending, "")

    def _require_fd_mtu(self) -> None:
        request = struct.pack("16si12x", self._channel.encode(), 0)
        _, mtu = struct.unpack("16si12x", fcntl.ioctl(self._socket, _SIOCGIFMTU, request))
        if mtu < FD_MTU:
            name = self._channel
            raise link.LinkDownError(  # down, too: an interface that was plugged in again may not be configured yet
                f"{name} cannot carry CAN FD frames: its mtu is {mtu}\n"
                f"  remedy: sudo ip link set {name} down && sudo ip link set {name} mtu {FD_MTU} && "
                f"sudo ip link set {name} up (hardware: with `fd on` and a `dbitrate`)"
            )

    def receive(self, timeout_s: float) -> link.Frame | None:
        deadline: float | None = None
        while True:
            try:
                data, ancillary, _, _ = self._socket.recvmsg(_FD_FRAME.size, _ANCILLARY_BYTES)
            except BlockingIOError:
                now = time.monotonic()
                if deadline is None:
                    deadline = now + timeout_s
                if now > deadline or not self._readable.poll(1e3 * (deadline - now)):
                    return None
                continue
            except OSError as error:
                raise self.failure(error) from error
            if not data:
                raise self.failure(OSError(errno.ENODEV, "end of file"))
            stamp_ns = self._read_ancillary(ancillary)
            identifier, length, flags = _HEADER.unpack_from(data)
            payload = data[_HEADER.size : _HEADER.size + length]
            if identifier & socket.CAN_ERR_FLAG:
                self.note_error_frame(identifier, payload)
                continue
            is_extended = bool(identifier & socket.CAN_EFF_FLAG)
            is_fd = len(data) == _FD_FRAME.size
            identifier &= socket.CAN_EFF_MASK if is_extended else socket.CAN_SFF_MASK
            return link.Frame(
                identifier,
                payload,
                stamp_ns,
                is_extended,
                is_fd,
                is_fd and bool(flags & BIT_RATE_SWITCH),  # nothing stands there in a classic frame
                is_fd and bool(flags & ERROR_STATE),
            )

    def _read_ancillary(self, ancillary: list[tuple[int, int, bytes]]) -> int:
        """Notes lost frames; returns the stamp [ns since 1970]."""
        stamp_ns = 0
        for level, kind, value in ancillary:
            if level != socket.SOL_SOCKET:
                continue
            if kind == SO_RXQ_OVFL:
                self.note_dropped(_COUNT.unpack(value)[0])
            else:
                stamp_ns = self._stamps.read(kind, value) or stamp_ns
        return stamp_ns or time.time_ns()  # the kernel begins to stamp a moment after it was asked to

    def note_dropped(self, count: int) -> None:
        """The socket lost so many frames since it was opened, counted in 32 bits."""
        self._lost.note(count)

    def note_error_frame(self, identifier: int, data: bytes) -> None:
        """Take the content of an error frame into the condition."""
        self._condition = controller.after_error_frame(self._condition, identifier, data)

    def send(
        self, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool, flags: link.FdFlags = link.SWITCHED
    ) -> None:
        deadline = time.monotonic() + SEND_PATIENCE_S
        bits = BIT_RATE_SWITCH * flags.bit_rate_switch | ERROR_STATE * flags.error_state_indicator
        frame = self._packed(frame_id, payload, is_extended, is_fd, bits)
        while not self._try_send(frame):
            if time.monotonic() > deadline:
                raise RunError(
                    f"the transmit queue of {self._channel} stayed full for {SEND_PATIENCE_S} s\n"
                    "  remedy: check that another node acknowledges and the bit rates agree, or lengthen the "
                    f"queue: sudo ip link set {self._channel} txqueuelen 1000"
                )
            time.sleep(SEND_RETRY_S)

    def try_send(self, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool) -> bool:
        return self._try_send(self._packed(frame_id, payload, is_extended, is_fd, BIT_RATE_SWITCH))

    def _packed(self, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool, flags: int) -> bytes:
        if len(payload) > (FD_LENGTHS[-1] if is_fd else CLASSIC_LENGTH):
            raise ValueError(f"{len(payload)} bytes do not fit into one frame")
        identifier = frame_id | (socket.CAN_EFF_FLAG if is_extended else 0)
        if is_fd:
            if not self._fd:
                raise RunError(f"{self._channel} was opened without CAN FD\n  remedy: set link.fd = true")
            return _FD_FRAME.pack(identifier, len(payload), flags, payload)
        return _CLASSIC_FRAME.pack(identifier, len(payload), payload)

    def _try_send(self, frame: bytes) -> bool:
        try:
            self._socket.send(frame, socket.MSG_DONTWAIT)
        except OSError as error:
            # ENOBUFS: the queue of the interface is full, which poll() cannot wait for. EAGAIN: our own.
            if error.errno in (errno.ENOBUFS, errno.EAGAIN):
                return False
            raise self.failure(error) from error
        return True

    def reconnect(self) -> None:
        self.close()
        self._open()  # anew: the old socket may be bound to a device that is gone
        self._condition = replace(self._condition, state=controller.BusState.ACTIVE)

    @property
    def dropped(self) -> int:
        return self._lost.count + self._condition.overruns

    @property
    def condition(self) -> controller.BusCondition:
        return self._condition

    @property
    def stamp_source(self) -> link.StampSource:
        return link.StampSource.HARDWARE if self._stamps.by_hardware else link.StampSource.KERNEL

    @property
    def descriptor(self) -> int:
        """File descriptor that `poll` finds readable while there is a frame; another one after `reconnect`."""
        return self._socket.fileno()

    @property
    def warnings(self) -> Sequence[str]:
        return self._warnings

    def close(self) -> None:
        self._socket.close()

    def failure(self, error: OSError) -> Exception:
        """Exception for `error` with its remedy."""
        name = self._channel
        if error.errno == errno.ENETDOWN:
            return link.LinkDownError(f"{name} is down\n  remedy: sudo ip link set {name} up")
        if error.errno in (errno.ENODEV, errno.ENXIO):
            types = sorted(Path("/sys/class/net").glob("*/type"))
            cans = [path.parent.name for path in types if path.read_text().strip() == str(ARPHRD_CAN)]
            present = ", ".join(cans) or "none"
            return link.LinkDownError(
                f"there is no interface {name} (CAN interfaces present: {present})\n"
                "  remedy: connect the device, or for a virtual bus: "
                f"sudo ip link add dev {name} type vcan && sudo ip link set {name} mtu {FD_MTU} up"
            )
        return RunError(f"{name} failed: {error.strerror or error}")


def _filters(receive_ids: Sequence[tuple[int, bool]] | None) -> bytes:
    """Kernel filters (identifier, mask): only data frames, and of these the wanted ones."""
    if receive_ids is None:
        return _FILTER.pack(0, socket.CAN_RTR_FLAG)
    exact = socket.CAN_EFF_FLAG | socket.CAN_RTR_FLAG
    filters = b""
    for frame_id, is_extended in receive_ids:
        bits = socket.CAN_EFF_MASK if is_extended else socket.CAN_SFF_MASK
        filters += _FILTER.pack(frame_id | (socket.CAN_EFF_FLAG if is_extended else 0), bits | exact)
    return filters
