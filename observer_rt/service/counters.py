"""What the service counts."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Counters:
    """What was counted since the start."""

    samples: int
    lost_samples: int
    interpolated_samples: int
    frames: int
    crc_errors: int
    length_errors: int
    sequence_errors: int
    repeated_frames: int
    old_frames: int
    restarts: int
    jumps: int
    events: int
    injections: int
    adoptions: int
    rejected_adoptions: int
    late_adoptions: int

    def since(self, earlier: "Counters") -> "Counters":
        """What was counted since an earlier look."""
        return Counters(**{name: count - getattr(earlier, name) for name, count in vars(self).items()})
