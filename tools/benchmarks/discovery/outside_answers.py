"""What `discover` answers on a case, and how far its models are from the plant where nothing was given."""

import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

from observer_rt.config.bench import load_injector
from observer_rt.engine.learning.healthy import NOT_FITTED
from observer_rt.identification.discovery.search.adequacy import healthy_of_fit
from observer_rt.identification.discovery.search.proposal import Proposal
from observer_rt.identification.discovery.search.results import SearchOutcome
from observer_rt.identification.discovery.search.search import Search
from observer_rt.identification.discovery.search.verdict import name_effects
from observer_rt.identification.likelihood.measurement import Measurement, with_healthy_offset
from observer_rt.identification.likelihood.operating_points import by_operating_point
from observer_rt.model import effects
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.effects import effective_model
from observer_rt.model.terms.term import Term
from tools.benchmarks.discovery.scoring import Misfit, misfit

IMPROBABLE = 0.02
Measurements = Sequence[Measurement]


@dataclass(frozen=True)
class ProposedTerms:
    """Terms proposed together, by equation and as text, beside effects of the vocabulary.

    may_enter: into an amended model, by the guard.
    """

    equations: tuple[str, ...]
    text: str
    effects: tuple[str, ...]
    may_enter: bool
    misfit: Misfit


@dataclass(frozen=True)
class OutsideAnswer:
    """What was answered.

    best: of the proposals; claims: names given; by_vocabulary: names its search ended with where they explain all,
    whatever is proposed besides; suspect: the equation an unknown effect is said to violate; before: of the model as
    given; own: of it where nothing is hidden; named: with what the vocabulary has for it; core_seconds: of processor
    time; stated: probability, names and equations of laws of every explanation that is not improbable.
    """

    verdict: str
    confidence: float
    claims: tuple[str, ...]
    by_vocabulary: tuple[str, ...]
    suspect: str
    best: ProposedTerms | None
    before: Misfit
    own: Misfit
    named: Misfit
    core_seconds: float
    stated: tuple[tuple[float, tuple[str, ...], tuple[str, ...]], ...] = ()


def ask_outside(
    recorded: Measurements, further: Measurements, healthy: Measurements, model: Path, without: Sequence[str]
) -> OutsideAnswer:
    """Ask about a case's recordings, with a model and a vocabulary without some names.

    further, healthy: not given, without noise and with the true rate, with the hidden effect and without it.
    """
    nominal = effective_model(load_injector(model))
    fitted = nominal.injector.baseline
    baseline = NOT_FITTED if fitted is None else healthy_of_fit(fitted, True)
    recordings = [with_healthy_offset(one, baseline) for one in recorded]
    points = [point.measurement for point in by_operating_point(recordings)]
    begin = time.process_time()
    with patch.dict(effects._in_use), noted_search() as noted:
        for name in without:
            del effects._in_use[name]
        findings = name_effects(nominal, points, os.cpu_count() or 1, baseline=baseline)
    core_seconds = time.process_time() - begin
    outcome = noted[-1]
    winner = outcome.winner if outcome.adequate else outcome.nominal
    said = str(findings.verdict), findings.confidence, findings.named.ids, winner.ids
    suspect = str(findings.unexplained.equation) if findings.unexplained is not None else ""
    best = proposed(findings.proposals[0], nominal, further) if findings.proposals else None
    misfits = misfit(nominal, further), misfit(nominal, healthy), misfit(winner.model(nominal), further)
    explained = ((odds, one.named, equations_of(one.terms)) for one, odds in outcome.posterior if odds >= IMPROBABLE)
    return OutsideAnswer(*said, suspect, best, *misfits, core_seconds, tuple(explained))


def equations_of(terms: Sequence[Term]) -> tuple[str, ...]:
    """Where terms stand in the model."""
    return tuple(str(term.equation) for term in terms)


def proposed(proposal: Proposal, nominal: EffectiveModel, further: Measurements) -> ProposedTerms:
    """A proposal beside the vocabulary, in plain values."""
    named, off = proposal.candidate.named, misfit(proposal.candidate.model(nominal), further)
    text = " + ".join((*(f"{t.equation}: {t.coefficient:.3g} {t.law}" for t in proposal.terms), *named))
    return ProposedTerms(equations_of(proposal.terms), text, named, proposal.may_enter, off)


@contextmanager
def noted_search() -> Iterator[list[SearchOutcome]]:
    """How searches end meanwhile."""
    noted: list[SearchOutcome] = []
    original = Search.run

    def run(self: Search) -> SearchOutcome:
        noted.append(original(self))
        return noted[-1]

    with patch.object(Search, "run", run):
        yield noted
