"""The user's files `bench.toml` and `injector.toml`: read, validated, refused with file, key and remedy."""

from collections.abc import Mapping
from enum import StrEnum
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from observer_rt.config.effects import check_effects
from observer_rt.config.links import (
    FurtherLinkConfig,
    LinkConfig,
    LinkName,
    NamedLink,
    Positive,
    named_links,
    refuse_shared_channels,
    require_link,
)
from observer_rt.config.toml_file import read_validated
from observer_rt.model.parameters import InjectorParameters

PACKAGE_DATA = Path(str(files("observer_rt.data")))
NOMINAL_INJECTOR = PACKAGE_DATA / "crin3_nominal.toml"
EXAMPLE_BENCH = PACKAGE_DATA / "example_bench.toml"


class Role(StrEnum):
    """The signals the observer lives on."""

    RAIL_PRESSURE = "rail_pressure"
    NEEDLE_LIFT = "needle_lift"
    LINE_PRESSURE = "line_pressure"


class OptionalRole(StrEnum):
    """Slow signals the observer makes use of where a bench has them."""

    LEARNING_ENABLE = "learning_enable"
    MEASURED_MASS = "measured_mass"
    FUEL_TEMPERATURE = "fuel_temperature"


class _Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class DatabaseConfig(_Section):
    file: str  # relative to the bench file; or the name of a database shipped with the package
    lenient: bool = False  # read it although signals overlap or do not fit
    link: str | None = None  # the bus its messages are on; None: the first


class SampledConfig(_Section):
    """Which signals of which message carry samples, and which: one of `signal`, `signals`, `pattern`."""

    message: str
    signal: str | None = None
    signals: tuple[str, ...] | None = None
    pattern: str | None = None
    time_base: str = "device"
    index: str | None = None  # signal with the index of the frame's first sample; "": none
    delay_us: Annotated[float, Field(ge=0, le=1e6)] | None = None  # from a frame's last sample to its stamp
    unit: str | None = None  # replaces the unit of the bus database
    link: str | None = None  # the bus the message is on, instead of its database's

    @model_validator(mode="after")
    def _one_way_to_name_signals(self) -> Self:
        if sum(value is not None for value in (self.signal, self.signals, self.pattern)) != 1:
            raise ValueError("name the samples by exactly one of 'signal', 'signals' or 'pattern'")
        return self

    @property
    def names(self) -> str | tuple[str, ...]:
        """The signals, as `lookup.signal_names` takes them."""
        return self.signal or self.pattern or self.signals or ()


class SignalConfig(SampledConfig):
    """The same of a role."""

    counter: str | None = None  # signal that counts the frames of a message without index
    rate_hz: Positive | None = None  # of a signal slower than sampling.rate_hz
    max_hold_ms: Positive | None = None  # between two samples of a slower signal, and after its last


class EnergizingConfig(SampledConfig):
    """The same of the energizing of the injector: with a unit of time its duration, else a level."""

    # from the start of energizing, within which the needle opens
    missing_after_ms: Annotated[float, Field(ge=0.1, le=50)] = 3.0


class SlowSignalConfig(_Section):
    """Which signal of which message carries an optional role: one value a frame."""

    message: str
    signal: str
    link: str | None = None  # the bus the message is on, instead of its database's


class SlowQuantityConfig(SlowSignalConfig):
    """The same of a signal with a unit."""

    unit: str | None = None  # replaces the unit of the bus database


class LearningEnableConfig(SlowSignalConfig):
    timeout_ms: Positive | None = None  # None: ten cycle times of the message


class FuelTemperatureConfig(SlowQuantityConfig):
    timeout_ms: Positive | None = None  # None: ten cycle times of the message


class SignalsConfig(_Section):
    rail_pressure: SignalConfig
    needle_lift: SignalConfig
    line_pressure: SignalConfig
    learning_enable: LearningEnableConfig | None = None
    measured_mass: SlowQuantityConfig | None = None  # of an injection
    fuel_temperature: FuelTemperatureConfig | None = None  # in the feed line
    energizing: EnergizingConfig | None = None

    def of(self, role: Role) -> SignalConfig:
        """The mapping of a role."""
        mapping: SignalConfig = getattr(self, role.value)
        return mapping

    @property
    def optional(self) -> tuple[tuple[OptionalRole, SlowSignalConfig], ...]:
        """The optional roles the bench has, with their mappings."""
        mappings = ((role, getattr(self, role.value)) for role in OptionalRole)
        return tuple((role, mapping) for role, mapping in mappings if mapping is not None)


class SamplingConfig(_Section):
    rate_hz: Annotated[float, Field(ge=1e3, le=1e6)] = 100e3
    meaning: Literal["instant"] = "instant"


class ModelConfig(_Section):
    file: str | None = None  # relative to the bench file; None: the nominal injector of the package


class NoiseConfig(_Section):
    """Noise of one sample (standard deviation), used until enough standstill was seen."""

    rail_pressure_MPa: Positive = 0.10  # noqa: N815 - units as on screens
    line_pressure_MPa: Positive = 0.15  # noqa: N815
    needle_lift_um: Positive = 0.4


class OutputsConfig(_Section):
    """Messages the results go out in; signals are found in them by their names in observer_fd.dbc."""

    injection_rate: str | Literal[False] = "InjectionRate"  # false: not published
    injection_summary: str = "InjectionSummary"
    status: str = "ObserverStatus"
    injector_id: Annotated[int, Field(ge=0, le=255)] = 1
    status_period_ms: Annotated[float, Field(ge=10, le=10_000)] = 100.0
    link: str | None = None  # the bus they are sent on, instead of their database's


class Training(StrEnum):
    """How phi is trained: ours, or the paper's scheme for comparison."""

    PREDICTION_ERROR = "prediction_error"
    PAPER = "paper"


class LearningConfig(_Section):
    enabled: bool = True
    training: Training = Training.PREDICTION_ERROR
    identification_gain: Positive | None = None  # 1/s, l of (5)
    event_gap_ms: Annotated[float, Field(ge=2, le=50)] = 10.0
    learning_delay_ms: Annotated[float, Field(ge=0, le=1000)] = 20.0
    lockstep: bool = False
    lookahead: Annotated[int, Field(ge=4, le=4)] = 4  # samples

    @model_validator(mode="after")
    def _gain_of_the_paper(self) -> Self:
        if self.training is Training.PAPER and self.identification_gain is None:
            raise ValueError("training = 'paper' needs 'identification_gain' [1/s], such as 1e5")
        if self.training is not Training.PAPER and self.identification_gain is not None:
            raise ValueError(f"'identification_gain' has no effect with training = '{self.training}'")
        return self


class BenchConfig(_Section):
    """All of `bench.toml`."""

    link: LinkConfig = LinkConfig()
    links: Mapping[LinkName, FurtherLinkConfig] = {}
    dbc: tuple[DatabaseConfig, ...] = Field(min_length=1)
    signals: SignalsConfig
    sampling: SamplingConfig = SamplingConfig()
    model: ModelConfig = ModelConfig()
    noise: NoiseConfig = NoiseConfig()
    outputs: OutputsConfig = OutputsConfig()
    learning: LearningConfig = LearningConfig()

    @property
    def buses(self) -> tuple[NamedLink, ...]:
        """All buses, that of `[link]` first; their places are the bus numbers."""
        return named_links(self.link, self.links)

    def bus_number(self, link: str | None) -> int:
        """Number of the bus with a name of `[links]`; None is the first."""
        return 0 if link is None else 1 + list(self.links).index(link)


class Bench(_Section):
    """A bench file with the files it names: what every command starts from."""

    path: Path
    config: BenchConfig
    databases: tuple[Path, ...]
    injector_path: Path
    injector: InjectorParameters


def load_injector(path: Path = NOMINAL_INJECTOR) -> InjectorParameters:
    """Read `injector.toml`. Raises `UserError` naming file, key, problem and remedy."""
    parameters = read_validated(InjectorParameters, path, "injector")
    check_effects(f"{path}: ", parameters.effects)
    return parameters


def load_bench(path: Path = EXAMPLE_BENCH, model: Path | None = None, lenient: bool = False) -> Bench:
    """Read `bench.toml` and the injector it names, or `model` instead of that.

    lenient: read every bus database as with its `lenient = true`.
    Raises `UserError` naming file, key, problem and remedy.
    """
    config = read_validated(BenchConfig, path, "bench")
    _check_links(path, config)
    if lenient:
        read_so = tuple(entry.model_copy(update={"lenient": True}) for entry in config.dbc)
        config = config.model_copy(update={"dbc": read_so})
    injector_path = model
    if injector_path is None:
        injector_path = path.parent / config.model.file if config.model.file else NOMINAL_INJECTOR
    return Bench(
        path=path,
        config=config,
        databases=tuple(_database_path(path, entry.file) for entry in config.dbc),
        injector_path=injector_path,
        injector=load_injector(injector_path),
    )


def _check_links(path: Path, config: BenchConfig) -> None:
    refuse_shared_channels(f"{path}: ", config.buses)
    signals = config.signals
    stated = [(f"dbc.{number}", entry.link) for number, entry in enumerate(config.dbc)]
    stated += [(f"signals.{role}", signals.of(role).link) for role in Role]
    stated += [(f"signals.{role}", mapping.link) for role, mapping in signals.optional]
    if signals.energizing is not None:
        stated.append(("signals.energizing", signals.energizing.link))
    stated.append(("outputs", config.outputs.link))
    for key, link in stated:
        require_link(f"{path}: {key}.link", link, config.links)


def _database_path(bench: Path, name: str) -> Path:
    beside = bench.parent / name
    shipped = PACKAGE_DATA / name
    if not beside.exists() and shipped.exists():
        return shipped
    return beside
