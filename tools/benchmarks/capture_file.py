"""Captures of SocketCAN as Wireshark and tcpdump write them, byte by byte."""

import struct
from collections.abc import Callable

from observer_rt.recording.canlog.can_log import LogFrame
from observer_rt.recording.canlog.pcap import ALL, ALL_2, CAN

Capture = Callable[[list[LogFrame], str, int], bytes]


def _kernel_frame(entry: LogFrame, order: str, link: int) -> bytes:
    """As it stands in a packet."""
    frame = entry.frame
    identifier = frame.frame_id | frame.is_extended << 31
    flags = frame.bit_rate_switch | frame.error_state_indicator << 1 | 4 * frame.is_fd
    head = struct.pack(f"{'>' if link == CAN else order}IBBxx", identifier, len(frame.payload), flags)
    data = head + frame.payload.ljust(64 if frame.is_fd else 8, b"\0")
    protocol, kind = 0xD if frame.is_fd else 0xC, 4 if entry.is_sent else 0
    if link == ALL:
        data = struct.pack(">HHH8xH", kind, 280, 0, protocol) + data
    elif link == ALL_2:
        data = struct.pack(">HHIHBB8x", protocol, 0, 7, 280, kind, 0) + data
    return data


def pcap(frames: list[LogFrame], order: str, link: int) -> bytes:
    """Of the older format; order: of bytes, `<` or `>`; link: kind of capture."""
    data = struct.pack(f"{order}IHHiIII", 0xA1B23C4D, 2, 4, 0, 0, 1 << 16, link)
    for entry in frames:
        packet = _kernel_frame(entry, order, link)
        data += (
            struct.pack(f"{order}IIII", *divmod(entry.frame.stamp_ns, 10**9), len(packet), len(packet))
            + packet
        )
    return data


def pcapng(frames: list[LogFrame], order: str, link: int, lost: int = 0) -> bytes:
    """Of the newer one; lost: frames that it says were dropped."""

    def block(kind: int, content: bytes) -> bytes:
        content += bytes(-len(content) % 4)
        return (
            struct.pack(f"{order}II", kind, len(content) + 12)
            + content
            + struct.pack(f"{order}I", len(content) + 12)
        )

    data = block(0x0A0D0D0A, struct.pack(f"{order}IHHq", 0x1A2B3C4D, 1, 0, -1))
    options = struct.pack(f"{order}HH5s3xHHB3xHH", 2, 5, b"can 0", 9, 1, 9, 0, 0)
    data += block(1, struct.pack(f"{order}HHI", link, 0, 0) + options)
    data += block(0xBAD, b"of another kind")
    for entry in frames:
        packet, stamp = _kernel_frame(entry, order, link), entry.frame.stamp_ns
        data += block(
            6,
            struct.pack(f"{order}IIIII", 0, stamp >> 32, stamp & 0xFFFFFFFF, len(packet), len(packet))
            + packet,
        )
    if lost:
        data += block(5, struct.pack(f"{order}IIIHHQHH", 0, 0, 0, 5, 8, lost, 0, 0))
    return data
