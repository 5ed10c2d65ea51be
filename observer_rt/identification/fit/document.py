"""The document of `fit --json`: verdict, structures, parameters and residuals, in printed units."""

from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import Field, PlainSerializer

from observer_rt.engine.estimation.phases import Phase
from observer_rt.foundation.documents import Document, DocumentPart, Number
from observer_rt.identification.fit.calibrate import (
    GATE,
    TOLERATED,
    CalibrationResult,
    FittedNumber,
    judged_by,
)
from observer_rt.identification.fit.report import (
    level_words,
    oddities,
    phase_name,
    recording_name,
    verdict_words,
)
from observer_rt.identification.fit.residuals import InjectedMass, Pair, Residual
from observer_rt.identification.fit.search import FailedStructure, FittedStructure
from observer_rt.model.baseline import Baseline

Whole = Annotated[Baseline, PlainSerializer(lambda one: one.model_dump(mode="json"))]


class TriedStructure(DocumentPart):
    """A structure that failed, or its chi2 by phase. held_out: judged on recordings it was not fitted to."""

    name: str
    failed: str = ""
    held_out: bool = False
    chi2: dict[str, Number] | None = None
    chi2_mean: Number = None
    free: tuple[str, ...] = ()
    converged: bool = False


class DeterminedDirection(DocumentPart):
    """Standard deviation of a combination of logarithms of parameters; share: of each, by symbol."""

    sigma: Number
    share: dict[str, Number]


class FitDocument(Document):
    """Result of `observer-rt fit`. mass_share: standard deviation of a mass, as a share, that comes of the model."""

    verdict: Literal["adequate", "inadequate"]
    verdict_words: str
    gate_chi2: float
    tolerated_share: float
    inadequate_phases: tuple[str, ...]
    structure: dict[str, str] = Field(description="the one chosen, and why")
    structures: tuple[TriedStructure, ...]
    parameters: dict[str, FittedNumber]
    kept: dict[str, dict[str, float | str]] = Field(description="left to the file: value, unit")
    directions: tuple[DeterminedDirection, ...]
    level: dict[str, str] = Field(description="what the absolute level of flow rests on")
    residuals: tuple[Residual, ...]
    open_loop_rms_MPa: Pair  # noqa: N815
    injections: tuple[InjectedMass, ...]
    mass_share: Number
    line_pressure_offsets_MPa: dict[str, Number]  # noqa: N815
    baseline: Whole
    warnings: tuple[str, ...]


def document_of(done: CalibrationResult, baseline: Baseline, warnings: Sequence[str]) -> FitDocument:
    """Puts a fit into printed units."""
    structure, comparison = done.fitted.structure, done.comparison
    names = [recording_name(done, number) for number in range(len(done.measurements))]
    folds = zip(done.fitted.calibration.folds, done.offsets.tolist(), strict=True)
    return FitDocument(
        schema=1,
        verdict="inadequate" if done.inadequate else "adequate",
        verdict_words=verdict_words(done),
        gate_chi2=GATE,
        tolerated_share=TOLERATED,
        inadequate_phases=tuple(map(phase_name, done.inadequate)),
        structure={
            "name": structure.name,
            "line_outflow": structure.outflow,
            "line_model": structure.line,
            "reason": done.choice.reason,
        },
        structures=tuple(map(_tried, done.choice.tried)),
        parameters=done.sizes,
        kept={one.name: {"value": one.of(done.injector) / one.si, "unit": one.unit} for one in done.kept},
        directions=tuple(
            DeterminedDirection(sigma=one.sigma, share=dict(one.share))
            for one in done.fitted.certainty.directions
        ),
        level={"from": done.level, "words": level_words(done)},
        residuals=comparison.residuals,
        open_loop_rms_MPa=comparison.open_loop,
        injections=comparison.masses,
        mass_share=done.mass_share,
        line_pressure_offsets_MPa={names[fold.recording]: offset for fold, offset in folds},
        baseline=baseline,
        warnings=(*warnings, *oddities(done)),
    )


def _tried(structure: FittedStructure | FailedStructure) -> TriedStructure:
    if isinstance(structure, FailedStructure):
        return TriedStructure(name=structure.structure.name, failed=structure.reason)
    left = judged_by(structure)
    return TriedStructure(
        name=structure.structure.name,
        held_out=structure.held_out is not None,
        chi2={phase_name(phase): left.chi2[phase] for phase in Phase},
        chi2_mean=left.mean,
        free=tuple(parameter.name for parameter in structure.calibration.free),
        converged=structure.minimum.converged,
    )
