"""The buses of a bench: `[link]`, `[links.<name>]`, and what the command line says instead."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from observer_rt.config.toml_file import Section
from observer_rt.foundation.errors import UserError, did_you_mean

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
BitRate = Annotated[float, Field(ge=5e3, le=2e7)]  # the fastest is that of CAN XL
Channel = Annotated[str, Field(min_length=1)]
LinkName = Annotated[str, Field(pattern=r"^\w[\w.-]*$")]


class LinkConfig(Section):
    """Where the frames come from and go to: one CAN bus."""

    interface: str = "socketcan"
    channel: Channel = "can0"
    fd: bool = True
    bit_rate: BitRate = 500e3  # bit/s, for the rules of `check`
    data_bit_rate: BitRate = 5e6


class FurtherLinkConfig(Section):
    """A further bus; what is left out is as in `[link]`."""

    channel: Channel
    interface: str | None = None
    fd: bool | None = None
    bit_rate: BitRate | None = None  # bit/s
    data_bit_rate: BitRate | None = None


@dataclass(frozen=True)
class NamedLink:
    """One of the buses of a bench; `name` in the bench file, empty for that of `[link]`."""

    name: str
    config: LinkConfig

    @property
    def label(self) -> str:
        """What messages to the user call it."""
        return f"{self.name} ({self.config.channel})" if self.name else self.config.channel

    @property
    def place(self) -> str:
        """Its section of the bench file."""
        return f"links.{self.name}" if self.name else "link"


def named_links(first: LinkConfig, further: Mapping[str, FurtherLinkConfig]) -> tuple[NamedLink, ...]:
    """All buses, complete; their places are the bus numbers."""
    links = [NamedLink("", first)]
    for name, config in further.items():
        stated = {key: value for key, value in config.model_dump().items() if value is not None}
        links.append(NamedLink(name, first.model_copy(update=stated)))
    return tuple(links)


def require_link(place: str, name: str | None, known: Mapping[str, FurtherLinkConfig]) -> None:
    """Raise `UserError` for the name of a bus that is not among the known ones; None is the first bus."""
    if name is None or name in known:
        return
    if not known:
        raise UserError(
            place, f"there is no link '{name}'", f"add [links.{name}] with its channel, or leave it out"
        )
    remedy = f"{did_you_mean(name, known)}known links: {', '.join(known)}"
    raise UserError(place, f"there is no link '{name}'", remedy)


def refuse_shared_channels(place: str, links: Sequence[NamedLink]) -> None:
    """Raise `UserError` where two buses are one channel; place: where the channels are said."""
    seen: dict[tuple[str, str], NamedLink] = {}
    for link in links:
        channel = link.config.interface, link.config.channel
        other = seen.setdefault(channel, link)
        if other is not link:
            raise UserError(
                f"{place}{link.place}.channel",
                f"is {' '.join(channel)}, as that of [{other.place}]",
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
