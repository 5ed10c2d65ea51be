"""Other identifiers and channels than those of the file, as `FROM=TO` on the command line."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import NamedTuple

from observer_rt.bus.can_frame import EXTENDED_MASK, STANDARD_MASK
from observer_rt.foundation.errors import UserError
from observer_rt.recording.replay.framing import TimedFrame


class Sent(NamedTuple):
    """A kind of frames that is sent on a bus."""

    bus: int
    identifier: int
    is_extended: bool


def channel_map(texts: Sequence[str]) -> dict[str, str]:
    """Bus channels by channel of the log. Raises `UserError` for text that is not `FROM=TO`."""
    return dict(_pair("--map-channel", text, "can0=vcan0") for text in _once("--map-channel", texts))


def identifier_map(texts: Sequence[str]) -> dict[int, int]:
    """New identifiers by old ones. Raises `UserError` for text that is not `FROM=TO`, or no identifiers."""
    pairs = (_pair("--map-id", text, "0x200=0x300") for text in _once("--map-id", texts))
    return {_identifier(old): _identifier(new) for old, new in pairs}


def remapped(frames: Iterator[TimedFrame], identifiers: Mapping[int, int]) -> Iterator[TimedFrame]:
    """The frames under their new identifiers, standard and extended ones alike."""
    if not identifiers:
        return frames
    return (frame._replace(frame_id=identifiers.get(frame.frame_id, frame.frame_id)) for frame in frames)


def remapped_identifiers(known: Collection[Sent], identifiers: Mapping[int, int]) -> frozenset[Sent]:
    """What will be sent.

    Raises `UserError` for an old identifier that is not among the known ones, for a new one too long for the kind
    of frame, and for one under which two kinds of frames would be sent.
    """
    for old in identifiers:
        if old not in {identifier for _, identifier, _ in known}:
            raise UserError("--map-id", f"no frame with identifier 0x{old:X} will be sent", "correct it")
    result: list[Sent] = []
    for bus, identifier, is_extended in sorted(known):
        new = identifiers.get(identifier, identifier)
        if new > STANDARD_MASK and not is_extended:
            raise UserError(
                "--map-id", f"0x{new:X} is too long for the standard frame 0x{identifier:X}", "at most 0x7FF"
            )
        if Sent(bus, new, is_extended) in result:
            raise UserError("--map-id", f"two kinds of frames would become 0x{new:X}", "choose another")
        result.append(Sent(bus, new, is_extended))
    return frozenset(result)


def _once(option: str, texts: Sequence[str]) -> Sequence[str]:
    sources = [text.partition("=")[0] for text in texts]
    for source in sources:
        if sources.count(source) > 1:
            raise UserError(option, f"'{source}' is mapped twice", "once is enough")
    return texts


def _pair(option: str, text: str, example: str) -> tuple[str, str]:
    old, _, new = text.partition("=")
    if not old or not new:
        raise UserError(option, f"'{text}' is not of the form FROM=TO", f"write it like {example}")
    return old, new


def _identifier(text: str) -> int:
    try:
        number = int(text, 0)
    except ValueError:
        number = -1
    if not 0 <= number <= EXTENDED_MASK:
        raise UserError("--map-id", f"'{text}' is no identifier", "write it like 0x200")
    return number
