"""The user's files `bench.toml` and `injector.toml`: read, validated, refused with file, key and remedy."""

from enum import StrEnum
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from observer_rt.effect_names import check_effects
from observer_rt.model.parameters import InjectorParameters
from observer_rt.toml_file import read_toml, validated

PACKAGE_DATA = Path(str(files("observer_rt.data")))
NOMINAL_INJECTOR = PACKAGE_DATA / "crin3_nominal.toml"
EXAMPLE_BENCH = PACKAGE_DATA / "example_bench.toml"

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class Role(StrEnum):
    """The signals the observer lives on."""

    RAIL_PRESSURE = "rail_pressure"
    NEEDLE_LIFT = "needle_lift"
    LINE_PRESSURE = "line_pressure"


class OptionalRole(StrEnum):
    """Slow signals the observer makes use of where a bench has them."""

    LEARNING_ENABLE = "learning_enable"
    MEASURED_MASS = "measured_mass"


class _Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class LinkConfig(_Section):
    """Where the frames come from and go to."""

    interface: str = "socketcan"
    channel: str = "can0"
    fd: bool = True
    bit_rate: Positive = 500e3  # bit/s, for `check`
    data_bit_rate: Positive = 5e6

    def replaced(self, interface: str | None, channel: str | None) -> "LinkConfig":
        """The same with another interface or channel; None keeps it."""
        changes = {"interface": interface, "channel": channel}
        return self.model_copy(update={key: value for key, value in changes.items() if value is not None})


class DatabaseConfig(_Section):
    file: str  # relative to the bench file; or the name of a database shipped with the package
    lenient: bool = False  # read it although signals overlap or do not fit


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

    @model_validator(mode="after")
    def _one_way_to_name_signals(self) -> Self:
        if sum(value is not None for value in (self.signal, self.signals, self.pattern)) != 1:
            raise ValueError("name the samples by exactly one of 'signal', 'signals' or 'pattern'")
        return self

    @property
    def names(self) -> str | tuple[str, ...]:
        """The signals, as `bus.database.signal_names` takes them."""
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


class SlowQuantityConfig(SlowSignalConfig):
    """The same of a signal with a unit."""

    unit: str | None = None  # replaces the unit of the bus database


class SignalsConfig(_Section):
    rail_pressure: SignalConfig
    needle_lift: SignalConfig
    line_pressure: SignalConfig
    learning_enable: SlowSignalConfig | None = None
    measured_mass: SlowQuantityConfig | None = None  # of an injection
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
    dbc: tuple[DatabaseConfig, ...] = Field(min_length=1)
    signals: SignalsConfig
    sampling: SamplingConfig = SamplingConfig()
    model: ModelConfig = ModelConfig()
    noise: NoiseConfig = NoiseConfig()
    outputs: OutputsConfig = OutputsConfig()
    learning: LearningConfig = LearningConfig()


class Bench(_Section):
    """A bench file with the files it names: what every command starts from."""

    path: Path
    config: BenchConfig
    databases: tuple[Path, ...]
    injector_path: Path
    injector: InjectorParameters


def load_injector(path: Path = NOMINAL_INJECTOR) -> InjectorParameters:
    """Read `injector.toml`. Raises `UserError` naming file, key, problem and remedy."""
    parameters = validated(InjectorParameters, read_toml(path), path)
    check_effects(f"{path}: ", parameters.effects)
    return parameters


def load_bench(path: Path = EXAMPLE_BENCH, model: Path | None = None) -> Bench:
    """Read `bench.toml` and the injector it names, or `model` instead of that.

    Raises `UserError` naming file, key, problem and remedy.
    """
    config = validated(BenchConfig, read_toml(path), path)
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


def _database_path(bench: Path, name: str) -> Path:
    beside = bench.parent / name
    shipped = PACKAGE_DATA / name
    if not beside.exists() and shipped.exists():
        return shipped
    return beside
