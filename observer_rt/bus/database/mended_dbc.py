"""DBC text as others leave it: what cantools refuses although decoding does not need it, set right or left out."""

import re
from typing import NamedTuple

from observer_rt.bus.can_frame import EXTENDED_MASK, STANDARD_MASK

_EXTENDED = 1 << 31  # of an identifier in a DBC file
_TEXT = r'"(?:\\.|[^"\\])*+"'
_MESSAGE = re.compile(
    r"^[ \t]*BO_[ \t]+(\d+)[ \t]+(\w+)[ \t]*:.*\n?((?:[ \t]*(?:SG_[ \t].*)?\n)*)", re.MULTILINE
)
_SIGNAL = re.compile(r"^[ \t]*SG_[ \t]+(\w+)", re.MULTILINE)
_OF_SIGNAL = re.compile(
    rf"^[ \t]*((?:VAL_|SIG_VALTYPE_)[ \t]+(\d+)[ \t]+(\w+))(?:[^;\"]|{_TEXT})*+;", re.MULTILINE
)
_IDENTIFIED = re.compile(
    rf"{_TEXT}|\b(BO_|SG_|VAL_|BO_TX_BU_|SIG_VALTYPE_|SIG_GROUP_|SG_MUL_VAL_)([ \t]+)(\d+)\b"
)


class MendedDbc(NamedTuple):
    """The text, and what was wrong with it."""

    text: str
    complaints: tuple[str, ...]


def mended_dbc(text: str) -> MendedDbc:
    """Take identifiers of more than 11 bits as extended; leave out impossible ones and values of absent signals."""
    complaints = []
    extended = set()
    for match in _MESSAGE.finditer(text):
        identifier, name = int(match[1]), match[2]
        if identifier & _EXTENDED or identifier <= STANDARD_MASK:
            continue
        is_possible = identifier <= EXTENDED_MASK
        complaints.append(
            f"message {name}: its standard identifier 0x{identifier:X} is more than 11 bits: "
            + ("it is taken as extended" if is_possible else "the message is left out")
        )
        if is_possible:
            extended.add(identifier)
        else:
            text = text.replace(match[0], "")
    if extended:
        text = _IDENTIFIED.sub(lambda match: _as_extended(match, extended), text)
    known = {(match[1], signal) for match in _MESSAGE.finditer(text) for signal in _SIGNAL.findall(match[3])}
    for match in list(_OF_SIGNAL.finditer(text)):
        if match.group(2, 3) not in known:
            complaints.append(f"{match[1]}: there is no such signal, it is left out")
            text = text.replace(match[0], "")
    return MendedDbc(text, tuple(complaints))


def _as_extended(match: re.Match[str], extended: set[int]) -> str:
    if match[3] is None or int(match[3]) not in extended:
        return match[0]
    return f"{match[1]}{match[2]}{int(match[3]) | _EXTENDED}"
