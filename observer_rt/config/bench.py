"""The user's bench file: buses with their databases, and the injectors on them. Read, validated, refused with remedy.

Sections of an injector (`InjectorConfig`) stand at the top, or of several as `[injectors.<name>]`, such as
`[injectors.left.signals.needle_lift]`. An omitted key is as at the top of the file, role by role: a
rail pressure stated once is that of all. There `{injector}` stands for each name, and result identifiers rise by
`outputs.id_step`; `outputs.injector_id` is 1, 2, ... if not stated.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path
from typing import Any

from observer_rt.config import bench_file
from observer_rt.config.injector_sections import InjectorConfig
from observer_rt.config.signals import with_exact_sensors
from observer_rt.config.toml_file import location_in, read_toml, validated
from observer_rt.foundation.documents import Section
from observer_rt.foundation.errors import UserError, did_you_mean
from observer_rt.foundation.files import file_hash
from observer_rt.model.accuracy import EXACT_PARAMETERS
from observer_rt.model.effective import Coefficients
from observer_rt.model.effects import effective_model
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.surroundings import at_temperature
from observer_rt.model.wave_line import with_cells

PACKAGE_DATA = Path(str(files("observer_rt") / "data"))
NOMINAL_INJECTOR = PACKAGE_DATA / "crin3_nominal.toml"
EXAMPLE_BENCH = PACKAGE_DATA / "example_bench.toml"
FUELS = PACKAGE_DATA / "fuels.toml"

_OFF_BUS = frozenset({"recording", "signals", "sampling", "model", "noise", "learning"})  # what files need

Content = Mapping[str, Any]
"""Sections of a bench by their names, and of its databases the SHA-256, by their paths."""


@dataclass(frozen=True)
class BenchInjector:
    """Injector of a bench, with its file's parameters; is_lift_dead: no lift sensor, the needle goes by commands."""

    file: bench_file.BenchFile
    config: InjectorConfig
    parameters_path: Path
    parameters: InjectorParameters
    is_lift_dead: bool = False

    @property
    def name(self) -> str:
        """Name, of `[injectors.<name>]`; empty where the file has one injector, which its own sections describe."""
        return self.file.name

    def location(self, key: str) -> str:
        """Place in the bench file of `key` of this injector, such as `signals.rail_pressure.unit`, for messages."""
        return self.file.location(*key.split("."))

    @property
    def sample_rate(self) -> float:
        """Sample rate of its observer [Hz]."""
        return self.config.sampling.rate_hz

    @property
    def has_lift(self) -> bool:
        """Whether a sensor shows its needle lift; else the needle goes by commands."""
        return self.config.signals.needle_lift is not None and not self.is_lift_dead

    @property
    def coefficients(self) -> Coefficients:
        """Coefficients of its model, effects in force included."""
        return effective_model(self.parameters).coefficients

    @property
    def state(self) -> Path | None:
        """The file of the learned state, if the bench file names one."""
        return self._path_of(self.config.state.file)

    @property
    def journal(self) -> Path | None:
        """The journal of injections, if the bench file names one."""
        return self._path_of(self.config.state.journal)

    @property
    def evidence(self) -> Path | None:
        """The folder of evidence, if the bench file names one."""
        return self._path_of(self.config.evidence.folder)

    def _path_of(self, file: str | None) -> Path | None:
        return self.file.path.parent / file if file else None


@dataclass(frozen=True)
class Bench:
    """A bench file with the files it names, from which every command starts; config: its shared sections."""

    path: Path
    config: bench_file.BusesConfig
    databases: tuple[Path, ...]
    injectors: tuple[BenchInjector, ...]

    @property
    def injector(self) -> BenchInjector:
        """The injector of a bench with one. Raises `UserError` for a bench with several."""
        if len(self.injectors) > 1:
            problem = f"the file has {len(self.injectors)} injectors, this is for one: {self._names}"
            remedy = f"choose one, such as --injector {self.injectors[0].name}"
            raise UserError(f"{self.path}: injectors", problem, remedy)
        return self.injectors[0]

    @property
    def exact(self) -> "Bench":
        """The bench as one of a simulation: sensors and geometry of its one injector are known exactly."""
        parameters = self.injector.parameters.model_copy(update={"accuracy": EXACT_PARAMETERS})
        signals = with_exact_sensors(self.injector.config.signals)
        return self.with_sections(signals=signals).with_parameters(parameters)

    @property
    def per_injector(self) -> "tuple[Bench, ...]":
        """The bench once for every injector, as if that were alone on its buses."""
        return tuple(replace(self, injectors=(injector,)) for injector in self.injectors)

    def of(self, name: str | None) -> "Bench":
        """The bench with one of its injectors; None: the bench as it is. Raises `UserError` for an unknown name."""
        if name is None:
            return self
        chosen = tuple(injector for injector in self.injectors if injector.name == name)
        if not chosen:
            names = [injector.name for injector in self.injectors if injector.name]
            meant = did_you_mean(name, names)
            remedy = f"{meant}known injectors: {self._names}" if names else "leave it out: the file has one injector"
            raise UserError(f"--injector {name}", f"{self.path} has no [injectors.{name}]", remedy)
        return replace(self, injectors=chosen)

    @property
    def _names(self) -> str:
        return ", ".join(injector.name for injector in self.injectors)

    def with_sections(self, **sections: Section) -> "Bench":
        """Bench with other sections of its one injector."""
        config = self.injector.config.model_copy(update=sections)
        return replace(self, injectors=(replace(self.injector, config=config),))

    def with_parameters(self, parameters: InjectorParameters) -> "Bench":
        """Bench with other parameters of its one injector."""
        return replace(self, injectors=(replace(self.injector, parameters=parameters),))

    def with_lift_sensor(self, is_dead: bool) -> "Bench":
        """Bench whose one injector has a lift sensor that is dead, or alive."""
        return replace(self, injectors=(replace(self.injector, is_lift_dead=is_dead),))


def load_injector(path: Path = NOMINAL_INJECTOR) -> InjectorParameters:
    """Read the parameters [SI] of an injector file. Raises `UserError` naming file, key, problem and remedy."""
    parameters = with_cells(_with_named_fuel(path, read_toml(path)))
    if parameters.effects or parameters.terms:
        from observer_rt.config.effects import check_effects, check_terms  # optional: [[effects]], [[terms]]

        check_effects(f"{path}: ", parameters.effects)
        check_terms(f"{path}: ", parameters)
    return parameters


def _with_named_fuel(path: Path, document: dict[str, Any]) -> InjectorParameters:
    """Parameters of a file's document, whose `[fluid]` may be a named fuel, at its own reference temperature."""
    stated, location = document.get("fluid"), location_in(path)
    if not isinstance(stated, dict) or "fuel" not in stated:
        return validated(InjectorParameters, document, location, "injector")
    fuels, name = read_toml(FUELS), str(stated["fuel"])
    if name not in fuels:
        remedy = f"{did_you_mean(name, fuels)}known fuels: {', '.join(fuels)}"
        raise UserError(location("fluid", "fuel"), f"{name!r} is no known fuel", remedy)
    document = {**document, "fluid": {**fuels[name], **stated}}
    parameters = validated(InjectorParameters, document, location, "injector")
    fluid, kept = parameters.fluid, {key: getattr(parameters.fluid, key) for key in stated}
    first = fluid.model_copy(update={"reference_temperature": fuels[name]["reference_temperature"]})
    warm = at_temperature(parameters.model_copy(update={"fluid": first}), document["fluid"]["reference_temperature"])
    return parameters.model_copy(update={"fluid": warm.fluid.model_copy(update=kept)})


def exact_text(path: Path) -> str:
    """Text of a bench or injector file with accuracies of 0 %, as of a simulation."""
    return re.sub(r"(?m)^(\w+_percent) = [\d.]+", r"\1 = 0.0", path.read_text(encoding="utf-8"))


def is_off_bus(shared: Mapping[str, Any]) -> bool:
    """Whether the content of a bench file with `[recording]` has no bus sections."""
    return "recording" in shared and _OFF_BUS.issuperset(shared)


def load_bench(path: Path = EXAMPLE_BENCH, model: Path | None = None, off_bus: bool = False) -> Bench:
    """Read a bench file and the injector files it names; model: injector file for all instead.

    off_bus: only files are read, so that the example completes a bench file with `[recording]` and no bus sections.
    Raises `UserError` naming file, key, problem and remedy.
    """
    shared = read_toml(path)
    if off_bus and is_off_bus(shared):
        shared = _completed(shared, read_toml(EXAMPLE_BENCH))
    named = {"injectors": shared.pop("injectors", {})}
    stated = validated(_InjectorNames, named, location_in(path), "bench").injectors
    buses = bench_file.read_buses(path, shared)
    files = [
        bench_file.BenchFile(path, name, number, shared, own)
        for number, (name, own) in enumerate((stated or {"": {}}).items())
    ]
    configs = [file.read() for file in files]
    bench_file.refuse_shared_channels(f"{path}: ", buses.buses)
    for number, entry in enumerate(buses.dbc):
        bench_file.require_link(f"{path}: dbc.{number}.link", entry.link, buses.links)
    for file, config in zip(files, configs, strict=True):
        for key, link in config.stated_links:
            bench_file.require_link(file.location(*key.split("."), "link"), link, buses.links)
    return Bench(
        path=path,
        config=buses,
        databases=tuple(_database_path(path, number, entry.file) for number, entry in enumerate(buses.dbc)),
        injectors=tuple(_injector(file, config, model) for file, config in zip(files, configs, strict=True)),
    )


def _completed(stated: Mapping[str, Any], by: Mapping[str, Any]) -> dict[str, Any]:
    """Tables, with the keys that they leave out taken from others."""
    result = {**by, **stated}
    for key in stated.keys() & by.keys():
        if isinstance(stated[key], Mapping) and isinstance(by[key], Mapping):
            result[key] = _completed(stated[key], by[key])
    return result


class _InjectorNames(Section):
    injectors: Mapping[bench_file.LinkName, Mapping[str, Any]]


def _injector(file: bench_file.BenchFile, config: InjectorConfig, model: Path | None) -> BenchInjector:
    if model is None and config.model.file:
        model = file.path.parent / config.model.file
        _require_file(file.location("model", "file"), model)
    model = model or NOMINAL_INJECTOR
    return BenchInjector(file, config, model, load_injector(model))


def _database_path(bench: Path, number: int, name: str) -> Path:
    own, shipped = bench.parent / name, PACKAGE_DATA / name
    if shipped.exists() and not own.exists():
        return shipped
    of_package = ", or " + ", ".join(sorted(path.name for path in PACKAGE_DATA.glob("*.dbc")))
    _require_file(f"{bench}: dbc.{number}.file", own, f"{of_package}, which come with the package")
    return own


def _require_file(location: str, path: Path, others: str = "") -> None:
    """Raise `UserError` for a path that leads to no file; others: what else could be named."""
    if not path.is_file():
        problem = f"{path} {'is a folder' if path.is_dir() else 'does not exist'}"
        raise UserError(location, problem, f"name a file, by its path from the bench file on{others}")


def content_of(bench: Bench) -> Content:
    """Sections of a bench, with its injector files and databases as they are now."""
    content = dict(bench.config)
    for injector in bench.injectors:
        prefix = f"injectors.{injector.name}." if injector.name else ""
        sections = {**dict(injector.config), "injector file": injector.parameters}
        content |= {f"{prefix}{name}": section for name, section in sections.items()}
    return content | {str(path): file_hash(path) for path in bench.databases}


def changes(before: Content, after: Content) -> list[str]:
    """Sections and files whose content differs."""
    return [key for key in {**before, **after} if before.get(key) != after.get(key)]
