"""What a model leaves unexplained: of the healthy injector, [baseline], and beside accepted terms, [remainder]."""

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer

from observer_rt.foundation.documents import Section

Share = Annotated[float, Field(ge=0, le=1)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class PhaseFigures(Section):
    """A figure of the normalised innovations by phase of an event: 1 for noise alone, None for an unseen phase."""

    standstill: NotNegative | None = None
    opening: NotNegative | None = None
    open: NotNegative | None = None
    closing: NotNegative | None = None
    after: NotNegative | None = None

    @classmethod
    def of(cls, figures: Mapping[str, float]) -> "PhaseFigures":
        """Convert figures by name of the phase, in which nan stands for an unseen phase."""
        return cls(**{name.lower(): value for name, value in figures.items() if not math.isnan(value)})

    def at(self, phase: str) -> float:
        """The figure of a phase by its name; 1 for an unseen phase."""
        value = getattr(self, phase.lower())
        return 1.0 if value is None else float(value)


class NoiseFigures(Section):
    """Standard deviation of a sample's white noise at `sample_rate_Hz` of the baseline."""

    rail_pressure_MPa: Annotated[float, Field(gt=0)]  # noqa: N815 - units as on screens
    line_pressure_MPa: Annotated[float, Field(gt=0)]  # noqa: N815
    needle_lift_um: Annotated[float, Field(gt=0)]


class Appearance(Section):
    """Apparent size of an effect on the healthy injector, in its unit."""

    mean: float = Field(description="over the recordings")
    uncertainty: float = Field(ge=0, description="standard deviation of the mean")
    scatter: float = Field(ge=0, description="standard deviation between operating points, without the noise")
    unit: str


class HealthyShape(Section):
    """Mean innovation of the healthy injector [MPa] at the knots of `engine.estimation.healthy_course`.

    Each slope is the change for every 40 MPa of rail pressure above 100 MPa.
    """

    opening: tuple[float, ...] = Field(description="after the needle leaves its seat, at 100 MPa")
    opening_slope: tuple[float, ...]
    closing: tuple[float, ...] = Field(description="after the needle is back on its seat, at 100 MPa")
    closing_slope: tuple[float, ...]


class HealthyRemainder(Section):
    """Innovations that a model leaves of the healthy injector: of the fit's predictor, or of the observer's x~."""

    line_pressure_offset_MPa: float = Field(default=0.0, description="mean offset to the rail sensor; of the fit")  # noqa: N815
    variance: PhaseFigures = Field(description="as of `Baseline`, beyond the shape that other recordings have")
    colour: PhaseFigures = Field(description="as of `Baseline`, beyond the shape that other recordings have")
    overdispersion: float = Field(
        default=1.0, ge=1, allow_inf_nan=False, description="by which events scatter beyond noise; of the observer"
    )
    appears: Mapping[str, Appearance] = Field(default={}, description="effects by id; of the fit, for `discover`")
    shape: HealthyShape

    @model_serializer(mode="wrap")
    def _as_stated(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Only the figures that were set: fit and observer set different ones."""
        return {name: value for name, value in dump(self).items() if name in self.model_fields_set}


class Baseline(Section):
    """Residuals of the fitted model on recordings of the healthy injector.

    Each figure of the innovations of the line pressure is that of the recording with the most left.
    """

    format: Literal[1] = 1
    adequate: bool
    level: Literal["file", "measured_rate", "measured_mass"] = Field(description="source of the level of all flows")
    mass_share: Share = Field(description="standard deviation of a mass, as a share, by the model and not by noise")
    sample_rate_Hz: Annotated[float, Field(gt=0)]  # noqa: N815
    injections: Annotated[int, Field(ge=1)]
    rail_pressure_MPa: tuple[float, float]  # noqa: N815 - lowest, highest
    variance: PhaseFigures = Field(description="mean square of the normalised innovations")
    chi2: PhaseFigures = Field(description="the same of scaled means of 8 of them")
    colour: PhaseFigures = Field(description="the larger of the same of means of 8 and of 20")
    noise: NoiseFigures
    ci95: Mapping[str, tuple[float, float]] = {}
    recordings: tuple[str, ...] = ()
    healthy: HealthyRemainder | None = Field(default=None, description="what `discover` compares recordings with")
    observer: HealthyRemainder | None = Field(default=None, description="what the observer compares events with")
    line_pressure_sensor_gain: float = Field(default=0.0, description="over the rail sensor's, gone before the fit")
    origin: str = ""
    date: str = ""


class Remainder(Section):
    """Residuals of a model whose terms were accepted in part: they belong to its stated uncertainty."""

    line_pressure_MPa: NotNegative  # noqa: N815 - rms beyond noise on events held out
    mass_share: Share  # standard deviation of a mass, as a share, by these residuals
    sample_rate_Hz: Annotated[float, Field(gt=0)]  # noqa: N815
    variance: PhaseFigures  # as of `Baseline`, with the terms in force
    observer: HealthyRemainder | None = None  # of the same recordings; None: it judged none of their events
    origin: str = ""
    date: str = ""
