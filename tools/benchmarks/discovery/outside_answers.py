"""What `discover` answers on a case, and how far its models are from the plant where nothing was given."""

import os
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

from observer_rt.config.bench import load_injector
from observer_rt.desk.evaluation.healthy_events import learn_laws
from observer_rt.engine.learning.healthy import NOT_FITTED
from observer_rt.engine.reports.learned_laws import leading
from observer_rt.identification.discovery.search.adequacy import healthy_of_fit
from observer_rt.identification.discovery.search.proposal import Proposal
from observer_rt.identification.discovery.search.results import SearchOutcome
from observer_rt.identification.discovery.search.search import Search
from observer_rt.identification.discovery.search.verdict import name_effects
from observer_rt.identification.likelihood.excerpts import by_operating_point
from observer_rt.identification.likelihood.measurement import Measurement, with_healthy_offset
from observer_rt.model import effects
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.terms.term import Term
from tools.benchmarks.discovery.scoring import Misfit, misfit

IMPROBABLE = 0.02
CONSTANT = {"chamber_pressure", "max_lift"}  # in laws, of an injector
Measurements = Sequence[Measurement]


@dataclass(frozen=True)
class ProposedTerms:
    """Terms proposed together, beside effects of the vocabulary; may_enter: an amended model; inputs: of the laws."""

    equations: tuple[str, ...]
    text: str
    effects: tuple[str, ...]
    may_enter: bool
    misfit: Misfit
    inputs: frozenset[str] = frozenset()


@dataclass(frozen=True)
class OutsideAnswer:
    """What was answered.

    best: of the proposals; claims: names given; by_vocabulary: names its search ended with where they explain all,
    whatever is proposed besides; before: of the model as given; own: of it where nothing is hidden; named: with what
    the vocabulary has for it; core_seconds: of processor time; stated: probability, names, equations and inputs of
    laws of every explanation that is not improbable.
    """

    verdict: str
    confidence: float
    claims: tuple[str, ...]
    by_vocabulary: tuple[str, ...]
    best: ProposedTerms | None
    before: Misfit
    own: Misfit
    named: Misfit
    core_seconds: float
    stated: tuple[tuple[float, tuple[str, ...], tuple[str, ...], frozenset[str]], ...] = ()


def ask_outside(
    recorded: Measurements, further: Measurements, healthy: Measurements, model: Path, without: Sequence[str]
) -> OutsideAnswer:
    """Ask about a case's recordings, with a model and a vocabulary without some names.

    further, healthy: not given, without noise and with the true rate, with the hidden effect and without it.
    """
    nominal = effects.effective_model(load_injector(model))
    fitted = nominal.injector.baseline
    baseline = NOT_FITTED if fitted is None else healthy_of_fit(fitted, True)
    recordings = [with_healthy_offset(one, baseline) for one in recorded]
    points = [point.measurement for point in by_operating_point(recordings)]
    begin = time.process_time()
    guess = leading(learn_laws(nominal.injector, [one.recording for one in recorded]))
    noted, run = list[SearchOutcome](), Search.run

    def run_noted(search: Search) -> SearchOutcome:
        noted.append(run(search))
        return noted[-1]

    with patch.dict(effects._in_use), patch.object(Search, "run", run_noted):
        for name in without:
            del effects._in_use[name]
        findings = name_effects(nominal, points, os.cpu_count() or 1, baseline=baseline, guess=guess)
    core_seconds = time.process_time() - begin
    outcome = noted[-1]
    winner = outcome.winner if outcome.adequate else outcome.nominal
    said = str(findings.verdict), findings.confidence, findings.named.ids, winner.ids
    best = proposed(findings.proposals[0], nominal, further) if findings.proposals else None
    misfits = misfit(nominal, further), misfit(nominal, healthy), misfit(winner.model(nominal), further)
    likely = [(odds, one.named, one.terms) for one, odds in outcome.posterior if odds >= IMPROBABLE]
    explained = tuple((odds, names, *laws_of(terms)) for odds, names, terms in likely)
    return OutsideAnswer(*said, best, *misfits, core_seconds, explained)


def laws_of(terms: Sequence[Term]) -> tuple[tuple[str, ...], frozenset[str]]:
    """Where terms stand in the model, and what they go by."""
    inputs = frozenset(one.word for term in terms for one in term.law.variables)
    return tuple(str(term.equation) for term in terms), inputs - CONSTANT


def proposed(proposal: Proposal, nominal: EffectiveModel, further: Measurements) -> ProposedTerms:
    """A proposal beside the vocabulary, in plain values."""
    named, off = proposal.candidate.named, misfit(proposal.candidate.model(nominal), further)
    text = " + ".join((*(f"{t.equation}: {t.coefficient:.3g} {t.law}" for t in proposal.terms), *named))
    where, inputs = laws_of(proposal.terms)
    return ProposedTerms(where, text, named, proposal.may_enter, off, inputs)
