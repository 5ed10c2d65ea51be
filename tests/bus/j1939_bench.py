"""A bench whose samples come in a message of J1939."""

from pathlib import Path

GROUP = 0x18FEF1FE
"""The identifier that the database has for it."""
DATABASE = f"""VERSION ""
BU_: Device
BO_ {GROUP | 1 << 31} Daq: 8 Device
 SG_ Rail : 0|16@1+ (0.1,0) [0|0] "bar" Device
 SG_ Lift : 16|16@1+ (0.1,0) [0|0] "um" Device
 SG_ Line : 32|16@1+ (0.1,0) [0|0] "bar" Device
 SG_ Count : 48|8@1+ (1,0) [0|0] "" Device
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";
BA_DEF_DEF_ "VFrameFormat" "ExtendedCAN";
BA_ "VFrameFormat" BO_ {GROUP | 1 << 31} 3;
"""
BENCH = """[[dbc]]
file = "user.dbc"
[[dbc]]
file = "observer_classic.dbc"
[outputs]
injection_rate = false
"""


def write_j1939_bench(folder: Path, is_j1939: bool = True) -> Path:
    """The bench file, beside its database; is_j1939: else the message is known by its whole identifier."""
    database = (
        DATABASE
        if is_j1939
        else DATABASE.replace('"VFrameFormat" BO_', '"VFrameFormat" BO_ ').replace(" 3;", " 1;")
    )
    (folder / "user.dbc").write_text(database)
    roles = {"rail_pressure": "Rail", "needle_lift": "Lift", "line_pressure": "Line"}
    signals = "".join(
        f'[signals.{role}]\nmessage = "Daq"\nsignal = "{name}"\ncounter = "Count"\n'
        for role, name in roles.items()
    )
    path = folder / "bench.toml"
    path.write_text(BENCH + signals)
    return path
