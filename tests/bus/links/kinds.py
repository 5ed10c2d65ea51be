"""Frames of every kind a link carries: identifier, payload, whether extended, whether CAN FD."""

KINDS = [
    (0x100, bytes(range(64)), False, True),
    (0x1ABCDEF0, bytes(48), True, True),
    (0x7FF, b"\x01\x02", False, False),
    (0x1, b"", True, False),
]
