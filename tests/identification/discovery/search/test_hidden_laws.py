"""Laws hidden in plants that share no code with the model, searched without the vocabulary."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from observer_rt.engine.learning.healthy import NOT_FITTED
from observer_rt.identification.discovery.search.term_library import InjectorTerms, RecordingSpan, library
from observer_rt.identification.discovery.search.term_search import TermSearch
from observer_rt.identification.likelihood.likelihood import joint_likelihood
from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.model.effects import effective_model
from observer_rt.model.term_effect import term_of
from observer_rt.model.terms.term import Term, TermEquation
from tests.identification.discovery.hidden import NOMINAL
from tests.identification.discovery.search.test_term_search import in_turn
from tests.observed_plants import recording_of
from tests.plants.laws import Laws
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench, Event, Needle, Shot, record

Change = Callable[[Bench], Bench]
POINTS = tuple(product((60e6, 100e6, 140e6), (0.6e-3, 1.9e-3)))  # Pa, s
INJECTIONS = 4


def found_in(change: Change) -> tuple[Term, ...]:
    """The terms found in recordings of a bench that is changed."""
    made = []
    for number, (pressure, duration) in enumerate(POINTS):
        shots = np.random.default_rng(number).uniform(0.0, 1e-5, INJECTIONS)  # s, anywhere between samples
        events = tuple(Event(pressure, (Shot(shot, duration),), Faults()) for shot in shots)
        bench = Bench(Injector(), Needle(), events, seed=number)
        made.append(recording_of(record(change(bench))))
    nominal = effective_model(NOMINAL)
    likelihood = joint_likelihood(measurements(made), nominal)
    span = RecordingSpan(float(made[0].time[-1]), INJECTIONS)
    problem = InjectorTerms(likelihood, nominal, list(library(span)), NOT_FITTED)
    best = TermSearch(problem, in_turn).run().best
    sized = zip(problem.hypothesis(best.chosen).effects, best.theta.tolist(), strict=True)
    return tuple(term for effect, size in sized if (term := term_of(effect, size)) is not None)


def plugged(bench: Bench) -> Bench:
    """Half of the nozzle is gone from the middle on, and the sensors are ten times better than usual."""
    half = Faults(orifice_area=-0.5)
    events = (*bench.events[:2], *(replace(event, faults=half) for event in bench.events[2:]))
    return replace(bench, events=events, noise=0.1)


def test_a_law_is_found_that_is_large_against_the_noise() -> None:
    (term,) = found_in(plugged)
    assert term.equation is TermEquation.NOZZLE_FLOW
    assert str(term.law) == "c * (injection_number > 2)"
    assert term.coefficient == pytest.approx(-0.5, abs=0.01)
