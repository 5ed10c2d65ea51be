"""The user's bench file as it is for one of its injectors: buses, and the sections that all injectors share."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from observer_rt.config.injector import InjectorConfig, OutputsConfig
from observer_rt.config.toml_file import Section, unknown_key, validated
from observer_rt.foundation.errors import UserError, did_you_mean

BitRate = Annotated[float, Field(ge=5e3, le=2e7)]  # the fastest is that of CAN XL
Channel = Annotated[str, Field(min_length=1)]
LinkName = Annotated[str, Field(pattern=r"^\w[\w.-]*$")]

NAME_PLACE = "{injector}"  # in texts at the top of the file
MOST_CPUS = 8192  # that Linux knows
RESULT_IDS = tuple(key for key in OutputsConfig.model_fields if key.endswith("_id") and key != "injector_id")


class LinkConfig(Section):
    """CAN bus by which frames are received and sent."""

    interface: str = "socketcan"
    channel: Channel = "can0"
    fd: bool = True
    bit_rate: BitRate = 500e3  # bit/s, for the rules of `check`
    data_bit_rate: BitRate = 5e6


class FurtherLinkConfig(Section):
    """A further bus; keys that are left out are as in `[link]`."""

    channel: Channel
    interface: str | None = None
    fd: bool | None = None
    bit_rate: BitRate | None = None  # bit/s
    data_bit_rate: BitRate | None = None


@dataclass(frozen=True)
class NamedLink:
    """Bus of a bench; `name` in the bench file, empty for that of `[link]`."""

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


def named_links(first: LinkConfig, further: Mapping[str, FurtherLinkConfig]) -> tuple[NamedLink, ...]:
    """Buses of a bench, complete; their places are the bus numbers."""
    links = [NamedLink("", first)]
    for name, config in further.items():
        stated = {key: value for key, value in config if value is not None}
        links.append(NamedLink(name, first.model_copy(update=stated)))
    return tuple(links)


def require_link(location: str, name: str | None, links: Mapping[str, FurtherLinkConfig]) -> None:
    """Raise `UserError` for the name of a bus that is not among the known ones; None is the first bus."""
    if name is None or name in links:
        return
    if not links:
        raise UserError(
            location, f"there is no link '{name}'", f"add [links.{name}] with its channel, or leave it out"
        )
    remedy = f"{did_you_mean(name, links)}known links: {', '.join(links)}"
    raise UserError(location, f"there is no link '{name}'", remedy)


def refuse_shared_channels(location: str, links: Sequence[NamedLink]) -> None:
    """Raise `UserError` where two buses are one channel; location: where the channels are stated."""
    seen: dict[tuple[str, str], NamedLink] = {}
    for link in links:
        channel = link.config.interface, link.config.channel
        other = seen.setdefault(channel, link)
        if other is not link:
            raise UserError(
                f"{location}{link.location}.channel",
                f"is {' '.join(channel)}, as that of [{other.location}]",
                "name another channel, or leave the section out",
            )


def of_links(
    option: str, texts: Sequence[str], links: Sequence[NamedLink], example: str = "can1"
) -> dict[int, str]:
    """Values of a repeatable option by bus number: `VALUE` for the first bus, `NAME=VALUE` for another.

    With one bus only all texts are values. The last of several for one bus counts. Raises `UserError` for a name that
    no bus has.
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
    """cpus: numbers of the processors that the loops have to themselves, in turn; None: those Linux keeps apart.

    priority: of the loops, in SCHED_FIFO; 0: none before other programs.
    """

    cpus: tuple[Annotated[int, Field(ge=0, lt=MOST_CPUS)], ...] | None = None
    priority: Annotated[int, Field(ge=0, le=99)] = 50  # that of the kernel's own interrupt threads


class BusesConfig(Section):
    """The sections of a bench file that all injectors share."""

    link: LinkConfig = LinkConfig()
    links: Mapping[LinkName, FurtherLinkConfig] = {}
    dbc: tuple[DatabaseConfig, ...] = Field(min_length=1)
    realtime: RealTimeConfig = RealTimeConfig()

    @property
    def buses(self) -> tuple[NamedLink, ...]:
        """Buses of a bench, that of `[link]` first; their places are the bus numbers."""
        return named_links(self.link, self.links)

    def bus_number(self, link: str | None) -> int:
        """Number of the bus with a name of `[links]`; None is the first."""
        return 0 if link is None else 1 + list(self.links).index(link)


class BenchConfig(InjectorConfig, BusesConfig):
    """Content of a bench file with one injector, or of one with several as the file is for one of them."""


@dataclass(frozen=True)
class BenchFile:
    """A bench file as it is for one injector: `own` sections of `[injectors.<name>]` before the shared ones.

    number: of the injector in the file, from 0.
    """

    path: Path
    name: str
    number: int
    shared: Mapping[str, Any]
    own: Mapping[str, Any]

    def read(self) -> BenchConfig:
        """Join the sections stated for all injectors and for this one. Raises `UserError` at the key at fault."""
        for key in self.own:
            if key not in InjectorConfig.model_fields:
                raise unknown_key(
                    f"{self.path}: injectors.{self.name}.{key}", key, InjectorConfig.model_fields
                )
        together = self._by_rule() if self.name else {**self.shared}
        for section, content in self.own.items():
            before = together.get(section, {})
            is_both = isinstance(before, dict) and isinstance(content, dict)
            together[section] = {**before, **content} if is_both else content
        return validated(BenchConfig, together, self.location, "bench")

    def _by_rule(self) -> dict[str, Any]:
        """The shared sections as they are for this injector: names, identifiers and the injector's own number."""
        shared = {
            section: _named(content, self.name) if section in InjectorConfig.model_fields else content
            for section, content in self.shared.items()
        }
        outputs = shared.get("outputs", {})
        if not isinstance(outputs, dict):
            return shared
        step = outputs.pop("id_step", None)
        if step is None:
            return {**shared, "outputs": {"injector_id": 1 + self.number, **outputs}}
        firsts = {key: outputs[key] for key in RESULT_IDS if key in outputs}
        if not all(isinstance(value, int) and value > 0 for value in (step, *firsts.values())) or not firsts:
            raise UserError(
                f"{self.path}: outputs.id_step",
                "is the step from the first injector's identifiers to the next one's, all whole numbers",
                f"state it beside {', '.join(RESULT_IDS)}",
            )
        moved = {key: first + self.number * step for key, first in firsts.items()}
        return {**shared, "outputs": {"injector_id": 1 + self.number, **outputs, **moved}}

    def location(self, *location: str | int) -> str:
        """Place of an entry in the file, by the keys that lead to it."""
        here: Any = self.own
        for key in location[:2]:
            here = here.get(key) if isinstance(here, Mapping) else None
        prefix = f"injectors.{self.name}." if self.name and here is not None else ""
        return f"{self.path}: {prefix}{'.'.join(map(str, location)) or 'file'}"


def _named(shared: Any, name: str) -> Any:
    """Value that the file states for all, with the name of one in it."""
    match shared:
        case str():
            return shared.replace(NAME_PLACE, name)
        case dict():
            return {key: _named(value, name) for key, value in shared.items()}
        case list():
            return [_named(value, name) for value in shared]
    return shared
