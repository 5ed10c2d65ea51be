"""What a model leaves unexplained: of the healthy injector, [baseline], and beside accepted terms, [remainder]."""

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer

from observer_rt.foundation.documents import Section

Share = Annotated[float, Field(ge=0, le=1)]
Quotient = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class PhaseFigures(Section):
    """A figure of the normalised innovations by phase of an event: 1 for noise alone, None for an unseen phase."""

    standstill: Quotient | None = None
    opening: Quotient | None = None
    open: Quotient | None = None
    closing: Quotient | None = None
    after: Quotient | None = None

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
    """Apparent size of an effect on the healthy injector, in its unit.

    mean: over the recordings; uncertainty: standard deviation of the mean; scatter: standard deviation between
    operating points, without the noise.
    """

    mean: float
    uncertainty: Annotated[float, Field(ge=0)]
    scatter: Annotated[float, Field(ge=0)]
    unit: str


class HealthyShape(Section):
    """Mean innovation of the healthy injector [MPa] at the knots of `engine.learning.healthy`.

    opening, closing: after the needle leaves its seat and after it returns, at 100 MPa of rail pressure; slopes:
    change for every 40 MPa above that.
    """

    opening: tuple[float, ...]
    opening_slope: tuple[float, ...]
    closing: tuple[float, ...]
    closing_slope: tuple[float, ...]


class HealthyRemainder(Section):
    """Innovations that a model leaves of the healthy injector: of the fit's predictor, or of the observer's x~.

    variance, colour: of the innovations beyond the shape, as of `Baseline`, each recording by the shape of the
    others. For `discover`, line_pressure_offset_MPa: mean offset of the line-pressure sensor against the rail's;
    appears: effects by id. For the observer, overdispersion: factor by which events scatter beyond noise.
    """

    line_pressure_offset_MPa: float = 0.0  # noqa: N815
    variance: PhaseFigures
    colour: PhaseFigures
    overdispersion: Annotated[float, Field(ge=1, allow_inf_nan=False)] = 1.0
    appears: Mapping[str, Appearance] = {}
    shape: HealthyShape

    @model_serializer(mode="wrap")
    def _as_stated(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Only the figures that were set: fit and observer set different ones."""
        return {name: value for name, value in dump(self).items() if name in self.model_fields_set}


class Baseline(Section):
    """Residuals of the fitted model on recordings of the healthy injector.

    variance, chi2, colour: of the innovations of the line pressure, of samples, of means of 8, and the larger of
    means of 8 and 20, each of the recording with the most left; mass_share: standard deviation of a mass, as a share,
    that comes of the model and not of noise; level: what the absolute level of flow rests on; healthy: what
    `discover` compares with, and observer: the observer, None of a file that was fitted before it was kept;
    line_pressure_sensor_gain: over the rail sensor's, taken out of the recordings before.
    """

    format: Literal[1] = 1
    adequate: bool
    level: Literal["file", "measured_rate", "measured_mass"]
    mass_share: Share
    sample_rate_Hz: Annotated[float, Field(gt=0)]  # noqa: N815
    injections: Annotated[int, Field(ge=1)]
    rail_pressure_MPa: tuple[float, float]  # noqa: N815 - lowest, highest
    variance: PhaseFigures
    chi2: PhaseFigures
    colour: PhaseFigures
    noise: NoiseFigures
    ci95: Mapping[str, tuple[float, float]] = {}
    recordings: tuple[str, ...] = ()
    healthy: HealthyRemainder | None = None
    observer: HealthyRemainder | None = None
    line_pressure_sensor_gain: float = 0.0
    origin: str = ""
    date: str = ""


class Remainder(Section):
    """Residuals of a model whose terms were accepted in part: they belong to its stated uncertainty.

    line_pressure_MPa: rms beyond noise on events held out; mass_share: standard deviation of a mass, as a share, that
    comes of it; variance: as of `Baseline`, with the terms in force; observer: what the observer leaves of the same
    recordings, None where it judged none of their events.
    """

    line_pressure_MPa: Annotated[float, Field(ge=0, allow_inf_nan=False)]  # noqa: N815
    mass_share: Share
    sample_rate_Hz: Annotated[float, Field(gt=0)]  # noqa: N815
    variance: PhaseFigures
    observer: HealthyRemainder | None = None
    origin: str = ""
    date: str = ""
