"""The user's bench file, as it reads for one of its injectors: buses, and the sections that all injectors share."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from pydantic import Field

from observer_rt.config.injector_sections import InjectorConfig, OutputsConfig
from observer_rt.config.toml_file import location_in, unknown_key, validated
from observer_rt.foundation.documents import Section
from observer_rt.foundation.errors import UserError, did_you_mean

BitRate = Annotated[float, Field(ge=5e3, le=2e7)]  # the fastest is that of CAN XL
Channel = Annotated[str, Field(min_length=1)]
LinkName = Annotated[str, Field(pattern=r"^\w[\w.-]*$")]

NAME_PLACEHOLDER = "{injector}"  # the injector's name, in texts of the shared sections
MOST_CPUS = 8192  # the most that Linux can be built for
RESULT_IDS = tuple(key for key in OutputsConfig.model_fields if key.endswith("_id") and key != "injector_id")


class LinkConfig(Section):
    """CAN bus on which frames are received and sent."""

    interface: str = "socketcan"
    channel: Channel = "can0"
    fd: bool = True
    bit_rate: BitRate = 500e3  # bit/s, for the rules of `check` and the drivers of python-can
    data_bit_rate: BitRate = 5e6

    @property
    def bit_rates(self) -> tuple[float, ...]:
        """Bit rates [bit/s]: of all frames, and of the data of CAN FD frames."""
        return (self.bit_rate, self.data_bit_rate) if self.fd else (self.bit_rate,)


class FurtherLinkConfig(Section):
    """A further bus; keys that are left out have the values of `[link]`."""

    channel: Channel
    interface: str | None = None
    fd: bool | None = None
    bit_rate: BitRate | None = None  # bit/s
    data_bit_rate: BitRate | None = None


class NamedLink(NamedTuple):
    """Bus of a bench, by its name in the bench file; the name is empty for the bus of `[link]`."""

    name: str
    config: LinkConfig

    @property
    def label(self) -> str:
        """Name of the bus in messages to the user."""
        return f"{self.name} ({self.config.channel})" if self.name else self.config.channel

    @property
    def location(self) -> str:
        """Section of the bus in the bench file."""
        return f"links.{self.name}" if self.name else "link"


def require_link(location: str, name: str | None, links: Mapping[str, FurtherLinkConfig]) -> None:
    """Raise `UserError` unless a bus has this name; None is the first bus."""
    if name is None or name in links:
        return
    remedy = f"add [links.{name}] with its channel, or leave it out"
    if links:
        remedy = f"{did_you_mean(name, links)}known links: {', '.join(links)}"
    raise UserError(location, f"there is no link '{name}'", remedy)


def refuse_shared_channels(location: str, links: Sequence[NamedLink]) -> None:
    """Raise `UserError` if two buses use one channel; location: where the channels are stated."""
    seen: dict[tuple[str, str], NamedLink] = {}
    for link in links:
        channel = link.config.interface, link.config.channel
        other = seen.setdefault(channel, link)
        if other is not link:
            problem = f"is {' '.join(channel)}, as that of [{other.location}]"
            remedy = "name another channel, or leave the section out"
            raise UserError(f"{location}{link.location}.channel", problem, remedy)


def values_by_bus(
    option: str, texts: Sequence[str], links: Sequence[NamedLink], example: str = "can1"
) -> dict[int, str]:
    """Values of a repeatable option by bus: `VALUE` for the first, `NAME=VALUE` for another, the last counts.

    With one bus every text is a value. Raises `UserError` for a name that no bus has.
    """
    names = [link.name for link in links]
    result: dict[int, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or len(links) == 1:
            name, value = "", text
        if name not in names:
            meant = did_you_mean(name, names[1:])
            remedy = f"{meant}write it like {names[-1]}={example}; known links: {', '.join(names[1:])}"
            raise UserError(f"{option} {text}", f"there is no link '{name}'", remedy)
        result[names.index(name)] = value
    return result


class DatabaseConfig(Section):
    file: str  # relative to the bench file; or the name of a database shipped with the package
    lenient: bool = False  # read it although signals overlap or do not fit
    link: str | None = None  # the bus its messages are on; None: the first


class RealTimeConfig(Section):
    """Processors and scheduling of the loops."""

    # numbers of the processors that the loops run on, in turn; None: those that Linux keeps free of other programs
    cpus: tuple[Annotated[int, Field(ge=0, lt=MOST_CPUS)], ...] | None = None
    # in SCHED_FIFO; 50 is that of the kernel's own interrupt threads, 0 leaves the loops in the normal scheduler
    priority: Annotated[int, Field(ge=0, le=99)] = 50


class BusesConfig(Section):
    """The sections of a bench file that all injectors share."""

    link: LinkConfig = LinkConfig()
    links: Mapping[LinkName, FurtherLinkConfig] = {}
    dbc: tuple[DatabaseConfig, ...] = Field(min_length=1)
    realtime: RealTimeConfig = RealTimeConfig()

    @property
    def buses(self) -> tuple[NamedLink, ...]:
        """Buses of a bench with all their keys, in the order of the bus numbers, that of `[link]` first."""
        links = [NamedLink("", self.link)]
        for name, config in self.links.items():
            stated = {key: value for key, value in config if value is not None}
            links.append(NamedLink(name, self.link.model_copy(update=stated)))
        return tuple(links)

    def bus_number(self, link: str | None) -> int:
        """Number of the bus with a name of `[links]`; None is the first."""
        return 0 if link is None else 1 + list(self.links).index(link)


def read_buses(path: Path, document: dict[str, Any]) -> BusesConfig:
    """Take the sections of the buses out of a bench file's document. Raises `UserError` at the key at fault."""
    sections = {**BusesConfig.model_fields, **InjectorConfig.model_fields}
    for key in document:
        if key not in sections:
            raise unknown_key(f"{path}: {key}", key, sections)
    stated = {key: document.pop(key) for key in BusesConfig.model_fields if key in document}
    return validated(BusesConfig, stated, location_in(path), "bench")


@dataclass(frozen=True)
class BenchFile:
    """Sections of a bench file for one of its injectors, whose own ones override those that all share."""

    path: Path
    name: str  # of the injector; empty in a file with one injector
    number: int  # of the injector in the file, from 0
    shared: Mapping[str, Any]
    own: Mapping[str, Any]  # sections of `[injectors.<name>]`

    def read(self) -> InjectorConfig:
        """Join the sections stated for all injectors and for this one. Raises `UserError` at the key at fault."""
        for key in self.own:
            if key not in InjectorConfig.model_fields:
                raise unknown_key(f"{self.path}: injectors.{self.name}.{key}", key, InjectorConfig.model_fields)
        joined = self._shared_for_this_injector() if self.name else {**self.shared}
        for section, content in self.own.items():
            shared = joined.get(section, {})
            are_tables = isinstance(shared, dict) and isinstance(content, dict)
            joined[section] = {**shared, **content} if are_tables else content
        return validated(InjectorConfig, joined, self.location, "bench")

    def _shared_for_this_injector(self) -> dict[str, Any]:
        """The shared sections with this injector's name, its identifiers and its number filled in."""
        shared: dict[str, Any] = _with_name(self.shared, self.name)
        outputs = shared.get("outputs", {})
        if not isinstance(outputs, dict):
            return shared
        if (step := outputs.pop("id_step", None)) is not None:
            firsts = {key: outputs[key] for key in RESULT_IDS if key in outputs}
            if not all(isinstance(value, int) and value > 0 for value in (step, *firsts.values())) or not firsts:
                problem = "is the step from the first injector's identifiers to the next one's, all whole numbers"
                raise UserError(f"{self.path}: outputs.id_step", problem, f"state it beside {', '.join(RESULT_IDS)}")
            outputs |= {key: first + self.number * step for key, first in firsts.items()}
        return {**shared, "outputs": {"injector_id": 1 + self.number, **outputs}}

    def location(self, *location: str | int) -> str:
        """Location of an entry in the file, by the keys that lead to it."""
        own: Any = self.own
        for key in location[:2]:
            own = own.get(key) if isinstance(own, Mapping) else None
        prefix = f"injectors.{self.name}." if self.name and own is not None else ""
        return f"{self.path}: {prefix}{'.'.join(map(str, location)) or 'file'}"


def _with_name(shared: Any, name: str) -> Any:
    """Value that the file states for all injectors, with the name of one of them in place of the placeholder."""
    match shared:
        case str():
            return shared.replace(NAME_PLACEHOLDER, name)
        case dict():
            return {key: _with_name(value, name) for key, value in shared.items()}
        case list():
            return [_with_name(value, name) for value in shared]
    return shared
