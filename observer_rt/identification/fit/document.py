"""The document of a fit, which `--json` writes and the screen shows: figures in printed units, and its words."""

import math
from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, PlainSerializer

from observer_rt.engine.estimation.phases import Phase
from observer_rt.foundation.documents import Document, DocumentPart, Number
from observer_rt.foundation.units import MEGAPASCAL, MILLISECOND
from observer_rt.identification.fit import calibrate
from observer_rt.identification.fit.comparison import RecordingMass, Residual
from observer_rt.identification.fit.forms import FittedNumber
from observer_rt.identification.fit.search import FailedStructure
from observer_rt.identification.fit.structures import Trial, judged_by
from observer_rt.model.baseline import Baseline
from observer_rt.model.plausibility import ImplausibleNumber, implausible

BaselineEntry = Annotated[Baseline, PlainSerializer(lambda one: one.model_dump(mode="json"))]
_DIAMETER_FITTED = "; line.diameter stands for A_L/(rho_L L_L) and was fitted with it"


class TriedStructure(DocumentPart):
    """A structure that failed, or its chi2 by phase. held_out: judged on recordings it was not fitted to."""

    name: str
    failed: str = ""
    held_out: bool = False
    chi2: dict[str, Number] | None = None
    chi2_mean: Number = None
    free: tuple[str, ...] = ()


class FitDocument(Document):
    """Result of `observer-rt fit`. mass_share: standard deviation of a mass, as a share, that comes of the model."""

    verdict: Literal["adequate", "inadequate"]
    verdict_words: str
    inadequate_phases: tuple[str, ...]
    causes: tuple[str, ...] = Field(description="effects tried by refits where more than noise is left, best first")
    structure: dict[str, str] = Field(description="the one chosen, and why")
    structures: tuple[TriedStructure, ...]
    parameters: dict[str, FittedNumber]
    kept: dict[str, dict[str, float | str]] = Field(description="left to the file: value, unit")
    level: dict[str, str] = Field(description="what the absolute level of flow rests on")
    residuals: tuple[Residual, ...]
    masses: tuple[RecordingMass, ...]
    injections: tuple[RecordingMass, ...] = Field(description="single ones that were weighed and took part")
    mass_share: Number
    told_shares: tuple[Number, ...] = Field(description="one sigma of a mass by one injection's pressures, at best")
    line_pressure_offsets_MPa: tuple[Number, ...] = Field(description="of each recording in `masses`")  # noqa: N815
    baseline: BaselineEntry
    warnings: tuple[str, ...]
    oddities: tuple[str, ...]


def document_of(done: calibrate.CalibrationResult, baseline: Baseline, warnings: Sequence[str]) -> FitDocument:
    """Puts a fit into printed units."""
    structure, comparison = done.fitted.structure, done.comparison
    return FitDocument(
        schema=1,
        verdict="adequate" if baseline.adequate else "inadequate",
        verdict_words=verdict_words(done),
        inadequate_phases=tuple(phase.label for phase in done.inadequate),
        causes=tuple(one.words for one in done.causes),
        structure={
            "name": structure.name,
            "line_outflow": structure.outflow,
            "line_model": structure.line,
            "reason": done.choice.reason,
        },
        structures=tuple(map(_tried, done.choice.tried)),
        parameters=done.sizes,
        kept={one.name: {"value": one.of(done.injector) / one.si, "unit": one.unit} for one in done.kept},
        level={"from": done.level_source, "words": level_words(done)},
        residuals=comparison.residuals,
        masses=comparison.masses(done.flow_factor),
        injections=comparison.injection_masses(done.flow_factor),
        mass_share=done.mass_share,
        told_shares=tuple(done.shares_by_pressures.tolist()),
        line_pressure_offsets_MPa=tuple(done.fitted.offsets.tolist()),
        baseline=baseline,
        warnings=tuple(warnings),
        oddities=tuple(oddities(done)),
    )


def _tried(structure: Trial) -> TriedStructure:
    if isinstance(structure, FailedStructure):
        return TriedStructure(name=structure.structure.name, failed=structure.reason)
    left = judged_by(structure)
    return TriedStructure(
        name=structure.structure.name,
        held_out=structure.held_out is not None,
        chi2={phase.label: left.chi2[phase] for phase in Phase},
        chi2_mean=left.mean,
        free=tuple(parameter.name for parameter in structure.calibration.free),
    )


def level_words(done: calibrate.CalibrationResult) -> str:
    """Describes what fixes the absolute level of flow."""
    if done.level_source is calibrate.LevelSource.RATE:
        return f"fixed by the measured injection rate{_DIAMETER_FITTED}"
    if done.level_source is calibrate.LevelSource.MASS:
        return f"fixed by the measured masses{_DIAMETER_FITTED}"
    return (
        "rests one to one on A_L/(rho_L L_L) of the file (line.diameter, line.length, fluid.density_line): pressures "
        "alone do not determine it. If that is 5 % too large, so are all masses and the fitted alpha_H, alpha_S, V_S "
        "and V_L/K_L. A measured rate (column injection_rate) or one measured mass (--mass) fixes it"
    )


def verdict_words(done: calibrate.CalibrationResult) -> str:
    """Adequate or not, where, and the cause that a refit showed."""
    words = [_fit_words(done)]
    if done.rate_misfit > calibrate.RATE_MISFIT:
        finding = "The measured rate contradicts the pressures: its shape"
        if done.inadequate:
            finding = "Not tried: whether the measured rate or the model has the wrong shape, which"
        off = f"is {done.rate_misfit:.1%} off (limit {calibrate.RATE_MISFIT:.0%}), and only its integrals were fitted"
        words.append(f"{finding} {off}")
    if done.meter:
        poles = ", ".join(f"{lag / MILLISECOND:.3g}" for lag in done.meter)
        words.append(f"Time constants of the rate's meter, [sampling] rate_meter_ms of a bench file: [{poles}]")
    odd = ", ".join(one.name for one in _beyond_physics(done))
    if odd and not done.inadequate:
        words.append(f"IMPLAUSIBLE: {odd}; correct the file and fit again")
    return ". ".join(words)


def _fit_words(done: calibrate.CalibrationResult) -> str:
    pressure = done.comparison.unexplained
    if not done.inadequate and done.not_observed:
        return f"INADEQUATE: the observer cannot learn with this model ({done.not_observed})"
    if not done.inadequate:
        words = f"adequate: chi2 at most {pressure.chi2[pressure.worst]:.2f} ({pressure.worst.label})"
        if done.above_limit:
            most = max(map(done.comparison.share, done.above_limit))
            words += (
                f", which is {most:.2%} of the swing of the line pressure; up to {calibrate.TOLERATED_SHARE:.0%} is "
                f"part of every interval. {_disagreement(done)}. {_causes(done)}"
            )
        return words
    where = ", ".join(f"{phase.label} {pressure.chi2[phase]:.3g}" for phase in done.inadequate)
    share = max(map(done.comparison.share, done.inadequate))
    return (
        f"INADEQUATE: chi2 above {calibrate.CHI2_LIMIT:g} in {where}, up to {share:.1%} of the swing of the line "
        f"pressure. {_disagreement(done)}. {_causes(done)}; --plot shows the residuals"
    )


def _causes(done: calibrate.CalibrationResult) -> str:
    cause = done.cause
    if cause is None:
        tried = ", ".join(one.words for one in done.causes)
        return f"Tried by refits, and not enough: {tried}" if tried else "No single effect explains much of it"
    what_to_do = "the recordings have it, not the model: state or repair it, and record again"
    if not cause.is_of_bench:
        what_to_do = "`observer-rt discover` takes it over, the fitted file given as --model"
    return f"A refit shows the cause: {cause.words}; {cause.effect.remedy or what_to_do}"


def _disagreement(done: calibrate.CalibrationResult) -> str:
    """Where most is left of the line pressure: phase and rail pressure, how much, and its sign."""
    after = done.comparison.after
    left = [
        (float(np.mean(z**2)), float(np.mean(z)), phase, fold.measurement.rail_pressure / MEGAPASCAL)
        for fold, recorded, judged in zip(after.folds, done.fitted.calibration.recordings, after.judged, strict=True)
        for phase in done.inadequate or done.above_limit
        if (z := judged.z[recorded.phases == phase]).size
    ]
    square, mean, phase, pressure = max(left)
    noise = after.innovation / MEGAPASCAL
    size = f"{noise * math.sqrt(square):.3g} MPa one sample ahead (noise alone {noise:.3g})"
    sign = "above" if mean > 0.0 else "below"
    return f"Most is left in {phase.label} at {pressure:.0f} MPa: {size}, measured more often {sign} the model"


def oddities(done: calibrate.CalibrationResult) -> list[str]:
    """Numbers that physics does not allow, with the entry to blame; those at an end of their range; masses missed."""
    odd = _beyond_physics(done)
    check = "" if done.inadequate else "; check {}"  # a model that lacks something makes numbers up for it
    result = [f"implausible: {one.words}{check.format(one.made_up_for or one.name)}" for one in odd]
    for parameter in done.fitted.calibration.free:
        value = parameter.of(done.injector)
        is_least = value < 1.01 * parameter.lowest and not parameter.linear  # the least of K_1 is a constant fuel
        if is_least or value > 0.99 * parameter.highest:
            size = f"{parameter.name} = {value / parameter.si:.4g} {parameter.unit}"
            result.append(f"{size} is at the end of the range tried")
    if (misfit := done.comparison.mass_misfit) > calibrate.TOLERATED_MISFIT:
        result.append(
            f"the measured masses are {misfit:.2%} (rms) beside the model's, beyond their sigma, which is in every "
            "interval: weigh again, or look for what the line lacks, such as a pilot valve"
        )
    return result


def _beyond_physics(done: calibrate.CalibrationResult) -> list[ImplausibleNumber]:
    names = {one.name for one in done.fitted.calibration.free}
    return [one for one in implausible(done.injector) if one.name in names]
