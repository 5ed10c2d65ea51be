"""The bus databases of a bench, DBC files: refused with file, line and reason, or repaired where asked for."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import cantools.database
from cantools.database.can import Database, Message

from observer_rt.bus.can_frame import EXTENDED_MASK, STANDARD_MASK
from observer_rt.bus.database.lookup import find_message
from observer_rt.config.bench import Bench
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import encoding_of

_CACHED = 16  # databases
_LENIENT = "or read it all the same: lenient = true in its [[dbc]]"
_AT_LINE = re.compile(r"at line (\d+)")  # Messages of cantools: where it stopped, an attribute, or signals, message.
_OF_PYTHON = re.compile(
    r"object (has no|is not|does not|cannot)|positional argument|unsupported operand|invalid literal|"
    r"not enough values|too many values|could not convert|out of range|must be (str|int|real|a )|unexpected keyword"
)
_UNDEFINED = re.compile(r"uses (\S+), which it does not define")
_IN_MESSAGE = re.compile(r"signals? (\w+).* in\s+message (\w+)")
_MESSAGE = re.compile(r"message (\w+)\W*$")
_OF_SIGNAL = re.compile(r"unused \w+ entries in DBC: (\w+ \d+ \w+)")
_CONVERT = "make a DBC of it: `canconvert {} {}.dbc`, of canmatrix, reads ARXML, DBF, KCD, SYM, XLS and some FIBEX"

_EXTENDED = 1 << 31  # of an identifier in a DBC file
_UNSENT = "3221225472"  # of VECTOR__INDEPENDENT_SIG_MSG, signals in no message, which cantools leaves out
_TEXT = r'"(?:\\.|[^"\\])*+"'
_MESSAGE_LINES = re.compile(r"(?m)^[ \t]*BO_[ \t]+(\d+)[ \t]+(\w+)[ \t]*:.*\n?((?:[ \t]*(?:SG_[ \t].*)?\n)*)")
_BIT_TIMING = re.compile(r"^([ \t]*BS_[ \t]*:)[ \t]*\d+[ \t]*:[ \t]*\d+[ \t]*,[ \t]*\d+;?", re.MULTILINE)
_BARE_DEFAULT = re.compile(rf"^([ \t]*BA_DEF_DEF_[ \t]+{_TEXT}[ \t]+)([A-Za-z_]\w*)([ \t]*;)", re.MULTILINE)
_SIGNAL = re.compile(r"^[ \t]*SG_[ \t]+(\w+)", re.MULTILINE)
_SIZE = re.compile(r"^[ \t]*(?:BO_[ \t]+\d+|SG_)[ \t]+(\w+)[^:\n]*:[ \t]*(\d+)(?:[ \t]*\|[ \t]*(\d+))?", re.MULTILINE)
_LARGEST = 1 << 15  # bytes of a message, and bits of it: far beyond any bus, but cantools makes an object of each
_SIGNAL_VALUES = re.compile(rf"(?m)^[ \t]*((?:VAL_|SIG_VALTYPE_)[ \t]+(\d+)[ \t]+(\w+))(?:[^;\"]|{_TEXT})*+;")
_OF = r"(?:(?:BU_|EV_)[ \t]+\w+|BO_[ \t]+\d+|SG_[ \t]+\d+[ \t]+\w+)?"
_COMMENTS = re.compile(  # texts elsewhere; comments in a row, and whether signals follow; an odd one, to its end
    rf"(?m){_TEXT}|^[ \t]*((?:CM_[ \t]+{_OF}\s*+{_TEXT}\s*+;\s*+)++)(?=(SG_[ \t])?)|"
    r"^[ \t]*(CM_[ \t]+\S(?s:.*?))(?:;[ \t]*$|(?=\n[ \t]*[A-Z]\w*_\b)|\Z)"
)
_IDENTIFIED = re.compile(rf"{_TEXT}|\b(BO_|SG_|VAL_|BO_TX_BU_|SIG_VALTYPE_|SIG_GROUP_|SG_MUL_VAL_)([ \t]+)(\d+)\b")


class BusMessage(NamedTuple):
    """A message, and the number of the bus it is on."""

    message: Message
    bus: int


class _BusDatabase(NamedTuple):
    """A database of the bench, and the number of the bus its messages are on."""

    path: Path
    lenient: bool
    content: Database
    bus: int


class BenchDatabases:
    """The databases a bench file names, read. Raises `UserError` for one that cannot be."""

    def __init__(self, bench: Bench) -> None:
        self._config = bench.config
        self.links = tuple(link.config for link in bench.config.buses)
        self.labels = tuple(link.label for link in bench.config.buses)
        self._databases = [
            _BusDatabase(path, entry.lenient, load_database(path, entry.lenient), bench.config.bus_number(entry.link))
            for path, entry in zip(bench.databases, bench.config.dbc, strict=True)
        ]

    def find(self, location: str, name: str, link: str | None) -> BusMessage:
        """The first message of this name, on its bus `link` before others. Raises `UserError` at `location`."""
        bus, candidates = None, self._databases
        if link is not None:
            bus = self._config.bus_number(link)
            candidates = sorted(self._databases, key=lambda database: database.bus != bus)
        with_name = (database for database in candidates if any(m.name == name for m in database.content.messages))
        database = next(with_name, candidates[0])
        with locating(location):
            return BusMessage(find_message(database.content, name), database.bus if bus is None else bus)

    def __iter__(self) -> Iterator[tuple[Path, BusMessage]]:
        """Iterate over all messages, used or not, on the buses of their databases."""
        for database in self._databases:
            yield from ((database.path, BusMessage(message, database.bus)) for message in database.content.messages)

    def overlooked_faults(self) -> tuple[str, ...]:
        """Faults of databases that were read leniently."""
        paths = (database.path for database in self._databases if database.lenient)
        return tuple(f"{path}: {complaint}" for path in paths for complaint in overlooked_faults(path))


@contextmanager
def locating(location: str) -> Iterator[None]:
    """Let errors that name message and signal also name the location in the bench file."""
    try:
        yield
    except UserError as error:
        raise UserError(location, f"{error.location} {error.problem}", error.remedy) from None


def load_database(path: Path, lenient: bool = False) -> Database:
    """Load a bus database, a DBC file; `lenient` also takes values outside the declared ranges.

    Signals that overlap or do not fit their message, and faults that decoding does not mind, are refused unless
    `lenient`: see `overlooked_faults`. Raises `UserError`: no such file, not readable, or not correct.
    """
    if path.suffix.lower() != ".dbc":
        raise UserError(str(path), "is no DBC file", _CONVERT.format(path.name, path.stem))
    try:
        return _loaded(path, lenient)[0]
    except FileNotFoundError:
        raise UserError(str(path), "no such file", "correct the path of the bus database") from None
    except OSError as error:
        raise UserError(str(path), f"cannot be read: {error.strerror}") from None
    except Exception as error:  # cantools fails in many ways on what it does not expect
        remedy = "mend the bus database"
        problem = reason = _reason(error)
        if not lenient:
            try:
                _loaded(path, lenient=True)
                remedy = f"{remedy}, {_LENIENT}"
            except Exception as second:  # leniency does not help
                if _reason(second) != reason:
                    problem = f"{reason}; and, where that is overlooked: {_reason(second)}"
        line = _line_of(path, reason)
        raise UserError(str(path) if line is None else f"{path}:{line}", problem, remedy) from None


def _loaded(path: Path, lenient: bool) -> tuple[Database, tuple[str, ...]]:
    """A database, and the faults that were corrected in its text."""
    stat = path.stat()
    return _load(path, lenient, stat.st_mtime_ns, stat.st_size)


@lru_cache(maxsize=_CACHED)
def _load(path: Path, lenient: bool, _changed_ns: int, _size: int) -> tuple[Database, tuple[str, ...]]:
    """Load a database, cached by its file's state: reading one takes as long as seconds of a recording."""
    text = _BIT_TIMING.sub(r"\1", _text_of(path))
    text = _SIGNAL_VALUES.sub(lambda use: "\n" * use[0].count("\n") if use[2] == _UNSENT else use[0], text)
    for size in _SIZE.finditer(text):
        if max(map(int, filter(None, size.groups()[1:]))) > _LARGEST:
            line, stated = 1 + text.count("\n", 0, size.start(1)), size[0].partition(":")[2].strip()
            raise ValueError(f"{size[1]} at line {line} is larger than any frame: {stated}")
    text, complaints = repaired_dbc(text) if lenient else (text, ())
    database = cantools.database.load_string(text, "dbc", strict=not lenient)
    for signal in (signal for message in database.messages if lenient for signal in message.signals):
        signal.minimum = signal.maximum = None
    return database, complaints


def _text_of(path: Path) -> str:
    content = path.read_bytes()
    return re.sub("\r\n?", "\n", content.decode(encoding_of(content), errors="replace"))


def overlooked_faults(path: Path) -> list[str]:
    """Faults that are passed over in a database that is read leniently; of overlaps the first of every message."""
    database, set_right = _loaded(path, lenient=True)
    complaints = list(set_right)
    for message in database.messages:
        try:
            message.refresh(strict=True)
        except cantools.Error as error:
            complaints.append(_reason(error))
            message.refresh(strict=False)
    return complaints


def _reason(error: Exception) -> str:
    """cantools' message on one line, without its format prefix and the quotes around it."""
    text = re.sub(r'^[A-Z]+: "(.*)"$', r"\1", str(error), flags=re.DOTALL)
    text = " ".join(text.split()).rstrip(".")
    missing = re.fullmatch(r"'([^']*)'", text)
    if missing:
        return f"uses {missing.group(1)}, which it does not define"
    if not text or not isinstance(error, cantools.Error | ValueError) or _OF_PYTHON.search(text):
        return (
            "is incomplete, or not of the kind its name says, or has what is not known here: what reads it fails "
            f"({text})"
        )
    return text


def _line_of(path: Path, reason: str) -> int | None:
    """The line of the file that a refusal speaks of, None where not known."""
    if (stopped := _AT_LINE.search(reason)) is not None:
        return int(stopped.group(1))
    lines = _text_of(path).splitlines()
    if (match := _OF_SIGNAL.match(reason) or _UNDEFINED.match(reason)) is not None:
        begin = f'BA_ "{match[1]}"' if match.re is _UNDEFINED else match[1]
        return next((number for number, line in enumerate(lines, 1) if line.startswith(begin)), None)
    if (match := _IN_MESSAGE.search(reason)) is not None:
        signal, message = match.groups()
    elif (match := _MESSAGE.search(reason)) is not None:
        signal, message = None, match.group(1)
    else:
        return None
    inside = False
    for number, line in enumerate(lines, 1):
        words = re.findall(r"\w+", line)
        if words[:1] == ["BO_"]:
            inside = words[2:3] == [message]
            if inside and signal is None:
                return number
        elif inside and signal is not None and words[:2] == ["SG_", signal]:
            return number
    return None


def repaired_dbc(text: str) -> tuple[str, tuple[str, ...]]:
    """Take identifiers of over 11 bits as extended; leave out impossible ones and values of absent signals.

    Puts quotes around bare defaults of attributes, leaves misplaced comments out. Returns the text, and its faults.
    """
    complaints = [f'{match[0].strip()}: "{match[2]}" is meant' for match in _BARE_DEFAULT.finditer(text)]
    text = _BARE_DEFAULT.sub(r'\1"\2"\3', text)

    def without_odd_comment(match: re.Match[str]) -> str:
        if match[2] is None and match[3] is None:
            return match[0]
        complaints.append(f"{match[0].strip().partition(chr(10))[0][:80]}: this comment is left out")
        return "\n" * match[0].count("\n")

    text = _COMMENTS.sub(without_odd_comment, text)
    extended = set()
    for match in _MESSAGE_LINES.finditer(text):
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
        text = _IDENTIFIED.sub(
            lambda m: f"{m[1]}{m[2]}{int(m[3]) | _EXTENDED}" if m[3] and int(m[3]) in extended else m[0], text
        )
    defined = {(match[1], signal) for match in _MESSAGE_LINES.finditer(text) for signal in _SIGNAL.findall(match[3])}
    for match in list(_SIGNAL_VALUES.finditer(text)):
        if match.group(2, 3) not in defined:
            complaints.append(f"{match[1]}: there is no such signal, it is left out")
            text = text.replace(match[0], "")
    return text, tuple(complaints)
