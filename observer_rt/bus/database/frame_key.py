"""One number that names a frame on all buses of a bench."""

# Added to the id of a frame.
EXTENDED = 1 << 32
BUS = 1 << 33  # for each bus before its own


def frame_key(frame_id: int, is_extended: bool, bus: int = 0) -> int:
    """One number for id and format of a frame on a bus."""
    return frame_id + (EXTENDED if is_extended else 0) + BUS * bus
