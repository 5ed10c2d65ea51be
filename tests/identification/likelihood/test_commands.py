"""Needles whose lift was not recorded: hidden ones of plants that share no code with the model, and jitter."""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import pytest

from observer_rt.config.bench import load_injector
from observer_rt.identification.discovery.search.adequacy import worst
from observer_rt.identification.discovery.search.candidates import Candidate
from observer_rt.identification.discovery.search.fits import Fitter
from observer_rt.identification.likelihood.likelihood import joint_likelihood
from observer_rt.identification.likelihood.measurement import measurements, with_free_needle
from observer_rt.identification.likelihood.reading import commands_of, with_commanded_lift
from observer_rt.identification.likelihood.windows import likelier_delays, without_jitter
from observer_rt.model.effects import VOCABULARY, effective_model
from tests.observed_plants import commanded
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench, Event, Needle, Shot, record
from tools.benchmarks.faults.bench import bouncing

NOMINAL = load_injector()
US = 1e-6
NEW = Faults()
NEEDLE = Needle(0.80, 0.90)  # the file's, as are 320 and 270 us of delay


@dataclass(frozen=True)
class HiddenCase:
    """What the plant does beyond the file: size of an effect, delays [s], needle, faults."""

    size: float
    opens: float = 320 * US
    shuts: float = 270 * US
    needle: Needle = NEEDLE
    faults: Faults = NEW
    bounce: float = 0.0  # um


CASES = {
    "opening_delay": HiddenCase(60 * US, opens=380 * US),
    "closing_delay": HiddenCase(-60 * US, shuts=210 * US),
    "opening_speed": HiddenCase(0.2, needle=Needle(0.96, 0.90)),
    "closing_speed": HiddenCase(-0.2, needle=Needle(0.80, 0.72)),
    "needle_bounce": HiddenCase(10 * US, bounce=25.0),
    "orifice_area": HiddenCase(-0.15, faults=Faults(orifice_area=-0.15)),
}


def fitter(hidden: HiddenCase, jitter: float = 8 * US) -> Fitter:
    made = []
    for number, (pressure, duration) in enumerate(product((60e6, 140e6), (0.6e-3, 1.9e-3))):
        shots = np.random.default_rng(number).uniform(0.0, 10 * US, 2)
        events = tuple(Event(pressure, (Shot(shot, duration),), hidden.faults) for shot in shots)
        bench = Bench(Injector(), hidden.needle, events, seed=number)
        bench = bouncing(bench, hidden.bounce, np.random.default_rng(0)) if hidden.bounce else bench
        made.append(commanded(bench, record(bench), hidden.opens, hidden.shuts, jitter).without_lift())
    lifted = measurements(with_commanded_lift(NOMINAL, made))
    answered = [replace(one, commands=commands_of(one.recording)) for one in lifted]
    nominal = effective_model(NOMINAL)
    return Fitter(joint_likelihood(with_free_needle(answered), nominal), nominal)


def left(of: Fitter, candidate: Candidate) -> float:
    """Ratio of the worst phase to its limit."""
    return worst(of.pool(candidate)).ratio


@pytest.mark.parametrize(("later", "is_seen"), [(0.0, False), (30 * US, True)])
def test_only_what_all_shots_have_in_common_is_no_jitter(later: float, is_seen: bool) -> None:
    fits = fitter(HiddenCase(later, opens=320 * US + later, shuts=270 * US + later))
    nothing = fits.nothing()
    assert left(fits, nothing) <= 1.0
    named = fits.fits_beside(nothing, [VOCABULARY["opening_delay"]])[0]
    assert (nothing.statistic - named.statistic > 25.0) is is_seen


@pytest.mark.parametrize("name", CASES)
def test_a_hidden_size_is_found_by_commands_alone(name: str) -> None:
    case = CASES[name]
    fits = fitter(case)
    ranked = fits.fits_beside(fits.nothing(), [VOCABULARY[one] for one in {name, "orifice_area", "opening_delay"}])
    assert ranked[0].ids == (name,)
    assert left(fits, ranked[0]) <= 1.0
    assert ranked[0].sizes[0] == pytest.approx(case.size, abs=4.5 * fits.sigmas(ranked[0])[0])


def test_whitening_is_by_the_covariance_of_the_shots() -> None:
    rng = np.random.default_rng(1)
    z, moved, bounds = rng.normal(size=12), rng.normal(size=(12, 2)), np.array([0, 5, 12])
    delays = likelier_delays(z, [np.zeros(2)] * 2, moved, bounds)
    answered = z + np.concatenate([moved[:5] @ delays[0], moved[5:] @ delays[1]])
    white, logs = without_jitter(answered, delays, moved, bounds)
    of_events = np.arange(12) >= 5
    covariance = np.eye(12) + np.where(of_events[:, None] == of_events, moved @ moved.T, 0.0)
    assert white @ white == pytest.approx(z @ np.linalg.solve(covariance, z), rel=1e-9)
    assert logs == pytest.approx(0.5 * np.linalg.slogdet(covariance)[1], rel=1e-9)
