"""Tries structures on few events; chooses the simplest that explains recordings left out as well as the best."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from observer_rt.engine.estimation.phases import Phase
from observer_rt.foundation.errors import RunError
from observer_rt.identification.fit import forms, search
from observer_rt.identification.fit.comparison import UnexplainedSignal
from observer_rt.identification.fit.forms import OPTIONAL_GROUPS, FreeParameter, Structure, with_values
from observer_rt.identification.fit.problem import Fold
from observer_rt.identification.fit.search import FailedStructure, FittedStructure, certain_groups, fitted, searched
from observer_rt.model.parameters import InjectorParameters, LineOutflow

MEAN_MARGIN, WORST_MARGIN = 1.15, 1.5  # Times the best chi2, of the mean and of a phase, up to which one is as good.
CHANCE_CHI2 = 0.03  # of a mean chi2 that is 1 for noise alone; what is below is chance
# Mean chi2 of a kind of line, up to which no further kind is tried.
ENOUGH_CHI2 = {"lump": MEAN_MARGIN + CHANCE_CHI2, "wave": search.EXPLAINED_CHI2}
Trial = FittedStructure | FailedStructure


@dataclass(frozen=True)
class Choice:
    """The structure chosen."""

    best: FittedStructure
    tried: Sequence[Trial]  # all structures
    as_good: Sequence[FittedStructure]  # those that explain the recordings as well as the best, `best` among them
    reason: str  # of the choice, in words

    @property
    def mass_spread(self) -> float:
        """Root mean square difference of the mass, as a share, between structures as good; 0 for a single one."""
        return float(np.sqrt(np.mean([(one.mass / self.best.mass - 1.0) ** 2 for one in self.as_good])))


def judged_by(structure: FittedStructure) -> UnexplainedSignal:
    """Residuals of a structure on recordings left out of its fit; on all, if none could be left out."""
    return structure.unexplained if structure.held_out is None else structure.held_out.unexplained


def tried_structures(
    structures: Sequence[Structure],
    file: InjectorParameters,
    further: Sequence[FreeParameter],
    folds: Sequence[Fold],
    progress: Callable[[float], None],
) -> list[Trial]:
    """Structures fitted roughly, kind by kind, until residuals are small. further: free beside a structure's own."""
    # the seat's first; a lump, whose sac is large, has neither flow when it is drained by the wrong one
    ordered = sorted(structures, key=lambda one: (one.line, one.outflow is not LineOutflow.SEAT))
    kinds = dict.fromkeys((one.line, one.outflow if one.line == "lump" else None) for one in ordered)
    tried: list[Trial] = []
    for line, outflow in kinds:
        alike = [one for one in ordered if one.line == line and outflow in (None, one.outflow)]
        tried += _trials(alike, file, further, folds)
        progress(len(tried) / len(structures))
        fits = [judged_by(one).mean for one in tried if isinstance(one, FittedStructure)]
        if min(fits, default=math.inf) <= ENOUGH_CHI2.get(line, 0.0):
            break
    return tried


def _trials(
    structures: Sequence[Structure], file: InjectorParameters, further: Sequence[FreeParameter], folds: Sequence[Fold]
) -> list[Trial]:
    """The fullest line of a kind, then those without one of its parts, then the best with the other outflow.

    In this order: parts stand in for one that a line lacks, from where a search would end beside the minimum.
    """
    conserving = [one for one in structures if one.outflow is LineOutflow.SEAT] or structures
    full = _fullest(max(conserving, key=lambda one: len(one.free)), file, further, folds)
    if isinstance(full, FailedStructure):
        return [full, *(FailedStructure(one, full.reason) for one in structures if one is not full.structure)]
    common = tuple(one for one in full.calibration.free if one not in full.structure.free)
    fits = [full]

    def simplified(structure: Structure, fuller: FittedStructure) -> Trial:
        return fitted(structure, fuller.injector, (*structure.free, *common), folds, search.ROUGH_ITERATIONS)

    for structure in sorted(conserving, key=lambda one: -len(one.free)):
        fuller = [one for one in fits if set(structure.free) < set(one.structure.free)]
        fewest = min((len(one.structure.free) for one in fuller), default=0)
        nearest = [one for one in fuller if len(one.structure.free) == fewest]
        if any(_is_as_good(judged_by(one), judged_by(full)) for one in nearest):
            trial = simplified(structure, min(nearest, key=lambda one: judged_by(one).mean))
            fits += [trial] if isinstance(trial, FittedStructure) else []
    best = _simplest(fits)
    other = [one for one in structures if one.free == best.structure.free and one is not best.structure]
    return [*fits, *(simplified(structure, best) for structure in other)]


def _fullest(
    structure: Structure, file: InjectorParameters, further: Sequence[FreeParameter], folds: Sequence[Fold]
) -> Trial:
    """A structure with every optional part that is certain and explains recordings left out better than without."""
    stiffens = forms.WAVE_DAMPING in structure.free or forms.STIFFENING.stated(file)
    every = [one for group in OPTIONAL_GROUPS for one in group]
    free = [*structure.free, *further, *every, *((forms.STIFFENING,) if stiffens else ())]
    full = searched(structure, file, free, folds)
    if isinstance(full, FailedStructure):
        return full

    def without(parts: Sequence[FreeParameter], fuller: FittedStructure) -> Trial:
        others = [one for one in fuller.calibration.free if one not in parts]
        stated = _as_stated(fuller.injector, parts, file, folds)
        return fitted(structure, stated, others, folds, search.ROUGH_ITERATIONS)

    has = [one for group in certain_groups(full) for one in group]
    if len(has) < len(every):
        full = without([one for one in every if one not in has], full)
    for parts in (has, [forms.STIFFENING] if stiffens and not forms.STIFFENING.stated(file) else []):
        if parts and isinstance(full, FittedStructure):
            simpler = without(parts, full)
            if isinstance(simpler, FittedStructure) and _is_as_good(judged_by(simpler), judged_by(full)):
                full = simpler
    return full


def _as_stated(
    injector: InjectorParameters, parts: Sequence[FreeParameter], file: InjectorParameters, folds: Sequence[Fold]
) -> InjectorParameters:
    """An injector with parts as in the file; fuel that stiffens no more is as stiff as at the mean rail pressure."""
    if forms.STIFFENING in parts:
        pressure = float(np.mean([fold.measurement.rail_pressure for fold in folds]))
        slope = injector.fluid.bulk_modulus_by_pressure - file.fluid.bulk_modulus_by_pressure
        stiffness = injector.fluid.bulk_modulus_line + slope * pressure
        injector = with_values(injector, (forms.STIFFNESS,), np.array([stiffness]))
    for part in parts:
        section = getattr(injector, part.section).model_copy(update={part.key: part.stated(file)})
        injector = injector.model_copy(update={part.section: section})
    return injector


def choose(tried: Sequence[Trial]) -> Choice:
    """The simplest structure as good as the best, first one that conserves mass. Raises `RunError` without any."""
    candidates = [one for one in tried if isinstance(one, FittedStructure)]
    if not candidates:
        why = "; ".join(f"{one.structure.name}: {one.reason}" for one in tried if isinstance(one, FailedStructure))
        raise RunError(f"no structure can be fitted to these recordings\n  {why}")
    best, as_good = _simplest(candidates), _as_good(candidates)
    return Choice(best, tried, as_good, _reason(best, as_good))


def _simplest(fits: Sequence[FittedStructure]) -> FittedStructure:
    return min(
        _as_good(fits),
        key=lambda one: (len(one.structure.free), one.structure.outflow is not LineOutflow.SEAT, judged_by(one).mean),
    )


def _as_good(fits: Sequence[FittedStructure]) -> list[FittedStructure]:
    lowest = min(map(judged_by, fits), key=lambda one: one.mean)
    return [one for one in fits if _is_as_good(judged_by(one), lowest)]


def _is_as_good(unexplained: UnexplainedSignal, best: UnexplainedSignal) -> bool:
    return unexplained.mean <= MEAN_MARGIN * best.mean + CHANCE_CHI2 and all(
        not np.isfinite(best.chi2[phase]) or unexplained.chi2[phase] <= WORST_MARGIN * max(best.chi2[phase], 1.0)
        for phase in Phase
    )


def _reason(best: FittedStructure, as_good: Sequence[FittedStructure]) -> str:
    unseen = judged_by(best)
    where = "of recordings left out" if best.held_out is not None else "of all there is"
    words = (
        f"{best.structure.name}: chi2 {where} {unseen.mean:.2f} in the mean of the phases, "
        f"{unseen.chi2[unseen.worst]:.2f} at worst ({unseen.worst.label})"
    )
    others = [f"{one.structure.name} ({judged_by(one).mean:.2f})" for one in as_good if one is not best]
    return words + (f"; no simpler, and hardly better: {', '.join(others)}" if others else "")
