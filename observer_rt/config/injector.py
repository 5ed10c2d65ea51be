"""What a bench file says of one injector: its signals, its model, how it is observed, where its results go."""

from enum import StrEnum
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from observer_rt.config.links import Positive
from observer_rt.config.recording import Meaning, RecordingConfig
from observer_rt.config.signals import Role, SignalsConfig
from observer_rt.config.toml_file import Section

Identifier = Annotated[int, Field(ge=0, le=0x1FFF_FFFF)]


class SamplingConfig(Section):
    rate_hz: Annotated[float, Field(ge=1e3, le=1e6)] = 100e3
    meaning: Meaning = Meaning.INSTANT
    bridge_ms: Annotated[float, Field(ge=0, le=5)] = 0.5  # of a signal that is frozen or drops out


class ModelConfig(Section):
    file: str | None = None  # relative to the bench file; None: the nominal injector of the package


class NoiseConfig(Section):
    """Noise of one sample (standard deviation), used until enough standstill was seen."""

    rail_pressure_MPa: Annotated[float, Field(gt=0, le=20)] = 0.10  # noqa: N815 - units as on screens
    line_pressure_MPa: Annotated[float, Field(gt=0, le=20)] = 0.15  # noqa: N815
    needle_lift_um: Annotated[float, Field(gt=0, le=200)] = 0.4


class OutputsConfig(Section):
    """Messages the results go out in; signals are found in them by their names in observer_fd.dbc."""

    injection_rate: str | Literal[False] = "InjectionRate"  # false: not published
    injection_summary: str = "InjectionSummary"
    status: str = "ObserverStatus"
    injection_rate_id: Identifier | None = None  # instead of that in the database; above 0x7FF it is extended
    injection_summary_id: Identifier | None = None
    status_id: Identifier | None = None
    injector_id: Annotated[int, Field(ge=0, le=255)] = 1
    status_period_ms: Annotated[float, Field(ge=10, le=10_000)] = 100.0
    link: str | None = None  # the bus they are sent on, instead of their database's


class Training(StrEnum):
    """How phi is trained: ours, or the paper's scheme for comparison."""

    PREDICTION_ERROR = "prediction_error"
    PAPER = "paper"


class LearningConfig(Section):
    enabled: bool = True
    on_inadequate_model: bool = (
        False  # learn, and publish as valid, with a model whose own fit was inadequate
    )
    training: Training = Training.PREDICTION_ERROR
    identification_gain: Positive | None = None  # 1/s, l of (5)
    event_gap_ms: Annotated[float, Field(ge=2, le=50)] = 10.0
    learning_delay_ms: Annotated[float, Field(ge=0, le=1000)] = 20.0
    lockstep: bool = False

    @model_validator(mode="after")
    def _gain_of_the_paper(self) -> Self:
        if self.training is Training.PAPER and self.identification_gain is None:
            raise ValueError("training = 'paper' needs 'identification_gain'; add it [1/s], such as 1e5")
        if self.training is not Training.PAPER and self.identification_gain is not None:
            raise ValueError(
                f"'identification_gain' has no effect with training = '{self.training}'; leave it out"
            )
        return self


class StateConfig(Section):
    """What is kept on disk; files are relative to the bench file, None: not kept."""

    file: str | None = None  # of what was learned
    journal: str | None = None  # of the injections
    save_within_s: Annotated[float, Field(ge=0.1, le=3600)] = 5.0  # of being learned, or of the injection


class InjectorConfig(Section):
    """The sections of a bench file that are an injector's."""

    signals: SignalsConfig
    sampling: SamplingConfig = SamplingConfig()
    model: ModelConfig = ModelConfig()
    noise: NoiseConfig = NoiseConfig()
    outputs: OutputsConfig = OutputsConfig()
    learning: LearningConfig = LearningConfig()
    state: StateConfig = StateConfig()
    recording: RecordingConfig | None = None  # of files in a layout of the user's own

    @model_validator(mode="after")
    def _means_are_ours(self) -> Self:
        if self.learning.training is Training.PAPER and self.sampling.meaning is Meaning.MEAN:
            raise ValueError(
                "learning.training = 'paper' knows no sampling.meaning = 'mean', only instants; change one of them"
            )
        return self

    @property
    def stated_links(self) -> list[tuple[str, str | None]]:
        """The buses named, with the sections that name them."""
        mappings = {f"signals.{role}": self.signals.of(role) for role in Role}
        optional = {f"signals.{role}": mapping for role, mapping in self.signals.optional}
        pulses = {} if self.signals.energizing is None else {"signals.energizing": self.signals.energizing}
        sections = mappings | optional | pulses | {"outputs": self.outputs}
        return [(key, section.link) for key, section in sections.items()]
