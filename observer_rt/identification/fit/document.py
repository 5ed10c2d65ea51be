"""The document of `fit --json`: verdict, structures, parameters and residuals, in printed units."""

from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import Field, PlainSerializer

from observer_rt.engine.estimation.phases import Phase
from observer_rt.foundation.documents import Document, DocumentPart, Number
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM
from observer_rt.identification.fit.calibrate import (
    GATE,
    TOLERATED,
    Calibrated,
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
from observer_rt.identification.fit.search import FailedStructure, Fitted
from observer_rt.model.baseline import Baseline

Whole = Annotated[Baseline, PlainSerializer(lambda one: one.model_dump(mode="json"))]
Pair = Annotated[
    dict[str, Number], Field(description="`file`: by the model given, `fitted`: by the fitted one")
]


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


class ResidualEntry(DocumentPart):
    """Residuals of a signal in a phase: rms in its unit; chi2 of means of 8 samples, 1 for noise alone."""

    signal: str
    phase: str
    rms: Pair
    unit: str
    chi2: Pair


class InjectionEntry(DocumentPart):
    """Masses of an injection: fitted, by the file's model, measured; null where there is none."""

    recording: str
    time_s: Number
    rail_pressure_MPa: Number  # noqa: N815 - units as printed
    mass_mg: Number
    file_mass_mg: Number
    measured_mass_mg: Number


class FitDocument(Document):
    """Result of `observer-rt fit`. mass_share: standard deviation of a mass, as a share, that comes of the model."""

    verdict: Literal["adequate", "inadequate"]
    verdict_words: str
    gate_chi2: float
    tolerated_share: float
    inadequate_phases: tuple[str, ...]
    odd_recording: str | None
    structure: dict[str, str] = Field(description="the one chosen, and why")
    structures: tuple[TriedStructure, ...]
    parameters: dict[str, FittedNumber]
    kept: dict[str, dict[str, float | str]] = Field(description="left to the file: value, unit")
    directions: tuple[DeterminedDirection, ...]
    level: dict[str, str] = Field(description="what the absolute level of flow rests on")
    residuals: tuple[ResidualEntry, ...]
    open_loop_rms_MPa: Pair  # noqa: N815
    injections: tuple[InjectionEntry, ...]
    mass_share: Number
    line_pressure_offsets_MPa: dict[str, Number]  # noqa: N815
    baseline: Whole
    warnings: tuple[str, ...]


def document_of(done: Calibrated, baseline: Baseline, warnings: Sequence[str]) -> FitDocument:
    """Puts a fit into printed units."""
    structure, comparison = done.fitted.structure, done.comparison
    names = [recording_name(done, number) for number in range(len(done.found))]
    folds = zip(done.fitted.calibration.folds, done.offsets.tolist(), strict=True)
    return FitDocument(
        schema=1,
        verdict="inadequate" if done.inadequate else "adequate",
        verdict_words=verdict_words(done),
        gate_chi2=GATE,
        tolerated_share=TOLERATED,
        inadequate_phases=tuple(map(phase_name, done.inadequate)),
        odd_recording=None if done.odd is None else names[done.odd.recording],
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
        residuals=tuple(
            ResidualEntry(
                signal=one.signal,
                phase=phase_name(one.phase),
                rms=_pair(one.rms, one.signal.si),
                unit=one.signal.unit,
                chi2=_pair(one.chi2),
            )
            for one in comparison.residuals
        ),
        open_loop_rms_MPa=_pair(comparison.open_loop, MEGAPASCAL),
        injections=tuple(
            InjectionEntry(
                recording=names[one.recording],
                time_s=one.time,
                rail_pressure_MPa=one.rail_pressure / MEGAPASCAL,
                mass_mg=one.after / MILLIGRAM,
                file_mass_mg=one.before / MILLIGRAM,
                measured_mass_mg=one.measured / MILLIGRAM,
            )
            for one in comparison.masses
        ),
        mass_share=done.mass_share,
        line_pressure_offsets_MPa={names[fold.recording]: offset for fold, offset in folds},
        baseline=baseline,
        warnings=(*warnings, *oddities(done)),
    )


def _tried(one: Fitted | FailedStructure) -> TriedStructure:
    if isinstance(one, FailedStructure):
        return TriedStructure(name=one.structure.name, failed=one.reason)
    left = judged_by(one)
    return TriedStructure(
        name=one.structure.name,
        held_out=one.held_out is not None,
        chi2={phase_name(phase): left.chi2[phase] for phase in Phase},
        chi2_mean=left.mean,
        free=tuple(parameter.name for parameter in one.calibration.free),
        converged=one.minimum.converged,
    )


def _pair(values: tuple[float, float], si: float = 1.0) -> dict[str, float | None]:
    return {"file": values[0] / si, "fitted": values[1] / si}
