"""The user's bench file as it is for one of its injectors, and the sections that all share."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from observer_rt.config.injector import InjectorConfig
from observer_rt.config.links import FurtherLinkConfig, LinkConfig, LinkName, NamedLink, named_links
from observer_rt.config.toml_file import Section, unknown_key, validated
from observer_rt.foundation.errors import UserError

NAME_PLACE = "{injector}"  # in texts at the top of the file
MOST_CPUS = 8192  # that Linux knows
RESULT_IDS = ("injection_rate_id", "injection_summary_id", "status_id")

# Keys of files that earlier versions printed, which could have one value only: with it they are passed over.
ONLY_VALUES: dict[str, dict[str, Any]] = {"learning": {"lookahead": 4}}


class DatabaseConfig(Section):
    file: str  # relative to the bench file; or the name of a database shipped with the package
    lenient: bool = False  # read it although signals overlap or do not fit
    link: str | None = None  # the bus its messages are on; None: the first


class RealTimeConfig(Section):
    """cpus: numbers of the processors that the loops have to themselves, in turn; None: those Linux keeps apart."""

    cpus: tuple[Annotated[int, Field(ge=0, lt=MOST_CPUS)], ...] | None = None


class BusesConfig(Section):
    """The sections of a bench file that all injectors share."""

    link: LinkConfig = LinkConfig()
    links: Mapping[LinkName, FurtherLinkConfig] = {}
    dbc: tuple[DatabaseConfig, ...] = Field(min_length=1)
    realtime: RealTimeConfig = RealTimeConfig()

    @property
    def buses(self) -> tuple[NamedLink, ...]:
        """All buses, that of `[link]` first; their places are the bus numbers."""
        return named_links(self.link, self.links)

    def bus_number(self, link: str | None) -> int:
        """Number of the bus with a name of `[links]`; None is the first."""
        return 0 if link is None else 1 + list(self.links).index(link)


class BenchConfig(InjectorConfig, BusesConfig):
    """All of a bench file with one injector, or of one with several as the file is for one of them."""


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
        """Both together. Raises `UserError` at the place that says it."""
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
        for section, only in ONLY_VALUES.items():
            if isinstance(content := together.get(section), dict):
                together[section] = {key: value for key, value in content.items() if only.get(key) != value}
        return validated(BenchConfig, together, self.place, "bench")

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

    def place(self, *location: str | int) -> str:
        """Where the file says something, by the keys that lead to it."""
        here: Any = self.own
        for key in location[:2]:
            here = here.get(key) if isinstance(here, Mapping) else None
        prefix = f"injectors.{self.name}." if self.name and here is not None else ""
        return f"{self.path}: {prefix}{'.'.join(map(str, location)) or 'file'}"


def _named(shared: Any, name: str) -> Any:
    """What the file says for all, with the name of one in it."""
    match shared:
        case str():
            return shared.replace(NAME_PLACE, name)
        case dict():
            return {key: _named(value, name) for key, value in shared.items()}
        case list():
            return [_named(value, name) for value in shared]
    return shared
