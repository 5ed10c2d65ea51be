"""A test bed that sends the optional inputs: its database, its part of a bench file, its frames by plain cantools."""

from pathlib import Path

import cantools
from cantools.database.can import Database

from observer_rt.files.replay.framing import TimedFrame
from tests.benches import attributes, sample_bench
from tests.device import encoded, protected

PROTECTED_ID, DATA_ID = 802, 0x1234
TEXT = f"""VERSION ""
BU_: Bed
BO_ 801 Bed: 8 Bed
 SG_ Page M : 0|8@1+ (1,0) [0|255] "" Bed
 SG_ LearnEnable m1 : 8|8@1+ (1,0) [0|255] "" Bed
 SG_ Mass m2 : 8|16@1+ (0.01,0) [0|655] "mg" Bed
BO_ {PROTECTED_ID} SafeBed: 8 Bed
 SG_ LearnEnableSafe : 24|2@1+ (1,0) [0|3] "" Bed
 SG_ MassSafe : 39|16@0+ (0.00000001,0) [0|0.000655] "kg" Bed
{attributes(protected={PROTECTED_ID: (5, DATA_ID)})}\
VAL_ 801 LearnEnable 255 "SNA" 1 "on" 0 "off" ;
VAL_ 801 Mass 65535 "SNA" ;
"""
BED: Database = cantools.database.load_string(TEXT, "dbc")
NOT_AVAILABLE = {"LearnEnable": 255, "Mass": 65535}
PAGES = {"LearnEnable": 1, "Mass": 2}


def slow_bench(folder: Path, roles: dict[str, tuple[str, str]], extra: str = "") -> Path:
    (folder / "bed.dbc").write_text(TEXT)
    signals = "".join(
        f'[signals.{role}]\nmessage = "{message}"\nsignal = "{signal}"\n' for role, (message, signal) in roles.items()
    )
    return sample_bench(folder, extra=f'{extra}\n[[dbc]]\nfile = "bed.dbc"\n{signals}')


def bed(signal: str, value: float | None) -> TimedFrame:
    """A frame of `Bed` with one of its signals; None: not available."""
    message = BED.get_message_by_name("Bed")
    payload = bytearray(message.encode({"Page": PAGES[signal], signal: value or 0}))
    if value is None:
        payload[1:3] = NOT_AVAILABLE[signal].to_bytes(2, "little")
    return encoded(message, bytes(payload))


def safe_bed(counter: int, enable: int = 1, mass: float = 0.0) -> TimedFrame:
    message = BED.get_message_by_name("SafeBed")
    return protected(encoded(message, {"LearnEnableSafe": enable, "MassSafe": mass}), DATA_ID, counter)
