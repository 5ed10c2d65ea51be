"""A bench file with two injectors on three buses: one rail pressure for both, each with its own lift and line."""

from pathlib import Path

SHARED = """[links.left]
channel = "can1"
[links.right]
channel = "can2"
[[dbc]]
file = "observer_fd.dbc"
[signals.rail_pressure]
message = "RailPressureBlock"
pattern = "RailPressure_{:02d}"
[sampling]
rate_hz = 100e3
[learning]
lockstep = true
event_gap_ms = 8
"""


def injector(name: str, number: int, below: str = "") -> str:
    """The sections of one of them; below: what leads to them."""
    return (
        f'[{below}signals.needle_lift]\nmessage = "NeedleLiftBlock"\npattern = "NeedleLift_{{:02d}}"\n'
        f'link = "{name}"\n'
        f'[{below}signals.line_pressure]\nmessage = "LinePressureBlock"\npattern = "LinePressure_{{:02d}}"\n'
        f'link = "{name}"\n[{below}outputs]\nlink = "{name}"\ninjector_id = {number}\n'
    )


BOTH = SHARED + "".join(
    injector(name, number, f"injectors.{name}.") for number, name in enumerate(("left", "right"), 1)
)


def two_injectors(folder: Path, further: str = "") -> Path:
    path = folder / "two.toml"
    path.write_text(BOTH + further)
    return path


def one_injector(folder: Path, name: str, number: int) -> Path:
    """One of them by itself, on the same buses."""
    path = folder / f"{name}.toml"
    path.write_text(SHARED + injector(name, number))
    return path
