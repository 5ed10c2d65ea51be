"""CAN frames, classic and FD: what one can hold, how it is named on all buses, and messages of J1939.

J1939: a parameter group names a message, whoever sends it.
"""

from bisect import bisect_left
from collections.abc import Iterable

CLASSIC_LENGTH = 8  # bytes, the most a classic frame carries
FD_LENGTHS: tuple[int, ...] = (*range(CLASSIC_LENGTH + 1), 12, 16, 20, 24, 32, 48, 64)  # bytes, by code
STANDARD_MASK, EXTENDED_MASK = 0x7FF, 0x1FFF_FFFF  # of identifiers

# Of the generic Linux interface.
CLASSIC_MTU = 16  # bytes of struct can_frame, whatever the frame carries
FD_MTU = 72  # and of struct canfd_frame
HEADER_BYTES = 8  # of both, before the data
EXTENDED_FLAG, REMOTE_FLAG, ERROR_FLAG = 0x8000_0000, 0x4000_0000, 0x2000_0000  # in their identifier
BIT_RATE_SWITCH, ERROR_STATE = (
    0x01,
    0x02,
)  # flags of struct canfd_frame: data sent faster, sender error passive
ARPHRD_CAN = 280  # kind of interface

# Added to the id of a frame.
EXTENDED = 1 << 32
BUS = 1 << 33  # for each bus before its own

_GROUP = 0x03FF_FF00  # the bits of a group that goes to all
_ADDRESSED_GROUP = 0x03FF_0000
_FIRST_TO_ALL = 0xF0  # of the byte that distinguishes the two kinds
ADDRESS = 0xFF


def length_code(length: int) -> int:
    """Data length code of the shortest frame that holds `length` bytes, of at most 64."""
    return bisect_left(FD_LENGTHS, length)


def length_of(code: int) -> int:
    """Bytes in a CAN FD frame of a data length code."""
    return FD_LENGTHS[min(code, len(FD_LENGTHS) - 1)]


def frame_key(frame_id: int, is_extended: bool, bus: int = 0) -> int:
    """Number for id and format of a frame on a bus."""
    return frame_id + (EXTENDED if is_extended else 0) + BUS * bus


class GroupIdentifier(int):
    """An extended identifier of a database that stands for its parameter group, under any source address."""

    @property
    def mask(self) -> int:
        """The bits that name the group."""
        return _GROUP if self >> 16 & 0xFF >= _FIRST_TO_ALL else _ADDRESSED_GROUP

    @property
    def group(self) -> int:
        """Identifier of the group, for every source address."""
        return self & self.mask


class ParameterGroups:
    """Gives received frames the identifiers that the database has for their groups.

    One source address counts for each group: that of the database, as soon as it is received, else the first.
    """

    def __init__(self, identifiers: Iterable[int]) -> None:
        """identifiers: of the database; those that are no `GroupIdentifier` are passed over."""
        self._of_group = {each.group: each for each in identifiers if isinstance(each, GroupIdentifier)}
        self._sender: dict[int, int] = {}  # source address
        self._known: dict[int, int] = {}
        self.left_out: dict[int, set[int]] = {}
        """Source addresses that do not count, by the identifiers of the database."""

    def __bool__(self) -> bool:
        return bool(self._of_group)

    def own(self, identifier: int) -> int:
        """The identifier of the database for an extended one received, itself where it has none or does not count."""
        known = self._known.get(identifier)
        return self._looked_up(identifier) if known is None else known

    def sender(self, own: int) -> int:
        """The source address that counts for an identifier of the database."""
        return self._sender.get(own, own & ADDRESS)

    def _looked_up(self, identifier: int) -> int:
        own = self._of_group.get(GroupIdentifier(identifier).group)
        if own is None:
            self._known[identifier] = identifier
            return identifier
        address = identifier & ADDRESS
        sender = self.sender(own) if own in self._sender else address
        if sender != address == own & ADDRESS:  # that of the database goes before
            self._known.clear()
            self.left_out.setdefault(own, set()).add(sender)
            sender = address
        self._sender[own] = sender
        if address != sender:
            self.left_out.setdefault(own, set()).add(address)
        self._known[identifier] = own if address == sender else identifier
        return self._known[identifier]
