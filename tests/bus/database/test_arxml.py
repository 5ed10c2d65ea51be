"""Scalings of ARXML files: what is read, and what is refused where it is used, for cantools would read it wrongly."""

from pathlib import Path

import pytest

from observer_rt.bus.database.catalogue import load_database
from observer_rt.bus.database.codec import signal_table
from observer_rt.foundation.errors import UserError

FILE = """<AUTOSAR xmlns="http://autosar.org/schema/r4.0"><AR-PACKAGES><AR-PACKAGE><SHORT-NAME>P</SHORT-NAME><ELEMENTS>
<CAN-CLUSTER><SHORT-NAME>C</SHORT-NAME><CAN-CLUSTER-VARIANTS><CAN-CLUSTER-CONDITIONAL><PHYSICAL-CHANNELS>
<CAN-PHYSICAL-CHANNEL><SHORT-NAME>H</SHORT-NAME><FRAME-TRIGGERINGS><CAN-FRAME-TRIGGERING><SHORT-NAME>T</SHORT-NAME>
<FRAME-REF>/P/F</FRAME-REF><CAN-ADDRESSING-MODE>STANDARD</CAN-ADDRESSING-MODE><IDENTIFIER>256</IDENTIFIER>
</CAN-FRAME-TRIGGERING></FRAME-TRIGGERINGS></CAN-PHYSICAL-CHANNEL></PHYSICAL-CHANNELS></CAN-CLUSTER-CONDITIONAL>
</CAN-CLUSTER-VARIANTS></CAN-CLUSTER><CAN-FRAME><SHORT-NAME>F</SHORT-NAME><FRAME-LENGTH>8</FRAME-LENGTH>
<PDU-TO-FRAME-MAPPINGS><PDU-TO-FRAME-MAPPING><SHORT-NAME>M</SHORT-NAME><PDU-REF>/P/U</PDU-REF>
<START-POSITION>0</START-POSITION></PDU-TO-FRAME-MAPPING></PDU-TO-FRAME-MAPPINGS></CAN-FRAME><I-SIGNAL-I-PDU>
<SHORT-NAME>U</SHORT-NAME><LENGTH>8</LENGTH><I-SIGNAL-TO-PDU-MAPPINGS><I-SIGNAL-TO-I-PDU-MAPPING><SHORT-NAME>V</SHORT-NAME>
<I-SIGNAL-REF>/P/S</I-SIGNAL-REF><PACKING-BYTE-ORDER>MOST-SIGNIFICANT-BYTE-LAST</PACKING-BYTE-ORDER>
<START-POSITION>0</START-POSITION></I-SIGNAL-TO-I-PDU-MAPPING></I-SIGNAL-TO-PDU-MAPPINGS></I-SIGNAL-I-PDU><I-SIGNAL>
<SHORT-NAME>S</SHORT-NAME><LENGTH>8</LENGTH><SYSTEM-SIGNAL-REF>/P/Y</SYSTEM-SIGNAL-REF></I-SIGNAL><SYSTEM-SIGNAL>
<SHORT-NAME>Y</SHORT-NAME><PHYSICAL-PROPS><SW-DATA-DEF-PROPS-VARIANTS><SW-DATA-DEF-PROPS-CONDITIONAL>
<COMPU-METHOD-REF>/P/L</COMPU-METHOD-REF></SW-DATA-DEF-PROPS-CONDITIONAL></SW-DATA-DEF-PROPS-VARIANTS></PHYSICAL-PROPS>
</SYSTEM-SIGNAL><COMPU-METHOD><SHORT-NAME>L</SHORT-NAME><CATEGORY>{category}</CATEGORY><COMPU-INTERNAL-TO-PHYS>
<COMPU-SCALES>{segments}</COMPU-SCALES></COMPU-INTERNAL-TO-PHYS></COMPU-METHOD></ELEMENTS></AR-PACKAGE></AR-PACKAGES>
</AUTOSAR>
"""
SEGMENT = """<COMPU-SCALE><LOWER-LIMIT>{}</LOWER-LIMIT><UPPER-LIMIT>{}</UPPER-LIMIT><COMPU-RATIONAL-COEFFS>
<COMPU-NUMERATOR><V>{}</V><V>{}</V></COMPU-NUMERATOR><COMPU-DENOMINATOR><V>1</V></COMPU-DENOMINATOR>
</COMPU-RATIONAL-COEFFS></COMPU-SCALE>"""
LOW, HIGH = SEGMENT.format(0, 99, 0, 0.1), SEGMENT.format(100, 255, -10, 0.2)


def written(folder: Path, category: str, *segments: str) -> Path:
    path = folder / "own.arxml"
    path.write_text(FILE.format(category=category, segments="".join(segments)))
    return path


@pytest.mark.parametrize("category", ["LINEAR", "SCALE_LINEAR", "SCALE_LINEAR_AND_TEXTTABLE"])
def test_one_segment_is_the_scale(tmp_path: Path, category: str) -> None:
    message = load_database(written(tmp_path, category, HIGH)).messages[0]
    (row,) = signal_table(message, ["S"])
    assert (row["scale"], row["offset"], row["lowest"], row["highest"]) == (0.2, -10.0, 100.0, 255.0)


@pytest.mark.parametrize(
    ("category", "segments"),
    [
        ("SCALE_LINEAR", (LOW, HIGH)),
        ("LINEAR", (LOW, HIGH)),
        ("SCALE_LINEAR_AND_TEXTTABLE", (LOW, HIGH)),
        ("RAT_FUNC", (LOW,)),
    ],
)
def test_what_is_not_one_scale_is_refused_where_it_is_used(
    tmp_path: Path, category: str, segments: tuple[str, ...], caplog: pytest.LogCaptureFixture
) -> None:
    message = load_database(written(tmp_path, category, *segments)).messages[0]
    with pytest.raises(UserError, match="message F, signal S: has several linear segments"):
        signal_table(message, ["S"])
    assert not caplog.records  # cantools has nothing to warn of
