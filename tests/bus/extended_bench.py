"""A bench whose samples come in a classic message with an extended identifier, counted by a byte."""

from pathlib import Path

IDENTIFIER = 0x18FEF1FE
DATABASE = f"""VERSION ""
BU_: Device
BO_ {IDENTIFIER | 1 << 31} Daq: 8 Device
 SG_ Rail : 0|16@1+ (0.1,0) [0|0] "bar" Device
 SG_ Lift : 16|16@1+ (0.1,0) [0|0] "um" Device
 SG_ Line : 32|16@1+ (0.1,0) [0|0] "bar" Device
 SG_ Count : 48|8@1+ (1,0) [0|0] "" Device
"""
BENCH = """[[dbc]]
file = "user.dbc"
[[dbc]]
file = "observer_classic.dbc"
[outputs]
injection_rate = false
"""


def write_extended_bench(folder: Path) -> Path:
    (folder / "user.dbc").write_text(DATABASE)
    roles = {"rail_pressure": "Rail", "needle_lift": "Lift", "line_pressure": "Line"}
    signals = "".join(
        f'[signals.{role}]\nmessage = "Daq"\nsignal = "{name}"\ncounter = "Count"\n' for role, name in roles.items()
    )
    path = folder / "bench.toml"
    path.write_text(BENCH + signals)
    return path
