"""The test bed's database of a pulse generator, and bench files whose energizing it tells."""

from pathlib import Path

import cantools
from cantools.database.can import Database

from tests.benches import sample_bench

LEVELS = 20  # samples in a frame of levels
SAFE_ID, SAFE_BLOCK_ID, DATA_ID = 0x340, 0x341, 0x2345
LEVEL_SIGNALS = "\n".join(f' SG_ Level_{k:02d} : {32 + 8 * k}|8@1+ (1,0) [0|1] "" Bed' for k in range(LEVELS))
SAFE_LEVEL_SIGNALS = "\n".join(
    f' SG_ SafeLevel_{k:02d} : {64 + 8 * k}|8@1+ (1,0) [0|1] "" Bed' for k in range(LEVELS)
)
TEXT = f"""VERSION ""
BU_: Bed
BO_ 816 PulseLevel: 8 Bed
 SG_ Energized : 0|2@1+ (1,0) [0|3] "" Bed
 SG_ PulseIndex : 8|32@1+ (1,0) [0|0] "" Bed
BO_ 817 PulseTime: 8 Bed
 SG_ Duration : 0|16@1+ (0.1,0) [0|6000] "us" Bed
 SG_ PulseIndex : 16|32@1+ (1,0) [0|0] "" Bed
BO_ 818 PulseBlock: 24 Bed
 SG_ SampleIndex : 0|32@1+ (1,0) [0|0] "" Bed
{LEVEL_SIGNALS}
BO_ 819 PulseCyclic: 8 Bed
 SG_ Energized : 0|2@1+ (1,0) [0|3] "" Bed
BO_ 820 PulseVolts: 8 Bed
 SG_ Volts : 0|8@1+ (1,0) [0|100] "V" Bed
 SG_ Short : 8|16@1+ (1,0) [0|0] "" Bed
BO_ {SAFE_BLOCK_ID} PulseSafeBlock: 32 Bed
 SG_ SafeIndex : 32|32@1+ (1,0) [0|0] "" Bed
{SAFE_LEVEL_SIGNALS}
BO_ 821 BedStatus: 4 Bed
 SG_ MissingInjections : 0|16@1+ (1,0) [0|65535] "" Bed
 SG_ UncommandedInjections : 16|16@1+ (1,0) [0|65535] "" Bed
BO_ 822 Triple: 8 Bed
 SG_ Rail : 0|16@1+ (0.005,-10) [0|0] "MPa" Bed
 SG_ Lift : 16|16@1+ (0.01,-50) [0|0] "um" Bed
 SG_ Line : 32|16@1+ (0.005,-10) [0|0] "MPa" Bed
 SG_ Level : 48|2@1+ (1,0) [0|3] "" Bed
 SG_ LevelPlain : 50|2@1+ (1,0) [0|3] "" Bed
 SG_ Time : 52|8@1- (1,-20) [0|0] "us" Bed
BO_ 823 Pages: 8 Bed
 SG_ Page M : 0|8@1+ (1,0) [0|255] "" Bed
 SG_ PageDuration m2 : 8|16@1+ (0.1,0) [0|6000] "us" Bed
 SG_ PageIndex m2 : 24|32@1+ (1,0) [0|0] "" Bed
 SG_ PageOther m1 : 8|16@1+ (1,0) [0|0] "" Bed
BO_ {SAFE_ID} PulseSafe: 8 Bed
 SG_ Duration : 24|16@1+ (0.1,0) [0|6000] "us" Bed
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","a","b","c","d","e","f","g","h","i","j","k","l","FD";
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_ BO_ "E2EProfile" INT 0 255;
BA_DEF_ BO_ "E2EDataId" INT 0 65535;
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_DEF_DEF_ "E2EProfile" 0;
BA_DEF_DEF_ "E2EDataId" 0;
BA_ "VFrameFormat" BO_ 818 14;
BA_ "VFrameFormat" BO_ {SAFE_BLOCK_ID} 14;
BA_ "E2EProfile" BO_ {SAFE_BLOCK_ID} 5;
BA_ "E2EDataId" BO_ {SAFE_BLOCK_ID} {DATA_ID};
BA_ "GenMsgCycleTime" BO_ 819 1;
BA_ "E2EProfile" BO_ {SAFE_ID} 5;
BA_ "E2EDataId" BO_ {SAFE_ID} {DATA_ID};
VAL_ 816 Energized 3 "SNA" ;
VAL_ 822 Level 3 "SNA" ;
"""
BED: Database = cantools.database.load_string(TEXT, "dbc")


class Told:
    """Lines of [signals.energizing]: by which message of the test bed the energizing is told."""

    LEVEL = 'message = "PulseLevel"\nsignal = "Energized"\nindex = "PulseIndex"\n'
    TIME = 'message = "PulseTime"\nsignal = "Duration"\nindex = "PulseIndex"\n'
    TIME_BY_STAMP = 'message = "PulseTime"\nsignal = "Duration"\n'
    LEVELS_IN_BLOCK = 'message = "PulseBlock"\npattern = "Level_{:02d}"\n'
    SAFE_BLOCK = 'message = "PulseSafeBlock"\npattern = "SafeLevel_{:02d}"\nindex = "SafeIndex"\n'
    CYCLIC = 'message = "PulseCyclic"\nsignal = "Energized"\n'
    SAFE = 'message = "PulseSafe"\nsignal = "Duration"\n'


def pulse_bench(folder: Path, energizing: str, extra: str = "") -> Path:
    """A bench with the lines of [signals.energizing], on a bus where frames take no time."""
    (folder / "bed.dbc").write_text(TEXT)
    link = f'[link]\ninterface = "virtual"\nchannel = "{folder.name}"\n'
    return sample_bench(
        folder, extra=f'{extra}\n{link}[[dbc]]\nfile = "bed.dbc"\n[signals.energizing]\n{energizing}'
    )


TRIPLE = {"rail_pressure": "Rail", "needle_lift": "Lift", "line_pressure": "Line"}
"""Signals of the message `Triple` that carry the roles."""


def triple_bench(folder: Path, signal: str) -> Path:
    """A bench whose samples come one a frame, without index, in the message that tells of the energizing."""
    path = pulse_bench(folder, f'message = "Triple"\nsignal = "{signal}"\n')
    text = path.read_text()
    for role, name in TRIPLE.items():
        start = text.index(f"[signals.{role}]")
        end = text.index("[", start + 1)
        text = f'{text[:start]}[signals.{role}]\nmessage = "Triple"\nsignal = "{name}"\n{text[end:]}'
    path.write_text(text)
    return path
