"""Every effect of the vocabulary, any size within its bounds, both kinds of line: a result, never an exception."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.identification.likelihood.likelihood import JointLikelihood, joint_likelihood
from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.effects import VOCABULARY, effective_model, sized
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.stability import in_stable_cells
from observer_rt.model.wave_line import STABLE, with_cells
from tests.identification.discovery.hidden import NOMINAL

RATES = (20e3, 50e3, 100e3, 200e3)


def _wave() -> InjectorParameters:
    line = NOMINAL.line.model_copy(update={"model": "wave", "damping": 1.0, "end_volume": 1e-8})
    return with_cells(NOMINAL.model_copy(update={"line": line, "line_outflow": "seat"}))


MODELS = {"lump": effective_model(NOMINAL), "wave": effective_model(_wave())}


@cache
def _likelihood(rate: float, line: str) -> JointLikelihood:
    """One injection at the highest usual pressure, where waves are fastest."""
    schedule = make_schedule([150e6], 1, 0.06, [0.8e-3])
    recording = simulate(NOMINAL, schedule, rate, (), SimulatedNoise()).recording
    return joint_likelihood(measurements([recording]), MODELS[line])


@given(
    rate=st.sampled_from(RATES),
    line=st.sampled_from(sorted(MODELS)),
    ids=st.lists(st.sampled_from(sorted(VOCABULARY)), min_size=1, max_size=2, unique=True),
    data=st.data(),
)
def test_a_candidate_is_judged_or_has_no_solution(
    rate: float, line: str, ids: list[str], data: st.DataObject
) -> None:
    model = MODELS[line]
    for effect in (VOCABULARY[one] for one in ids):
        shares = [
            data.draw(st.sampled_from((0.0, 0.5, 1.0)) | st.floats(0.0, 1.0)) for _ in effect.parameters
        ]
        values = [
            p.lowest + s * (p.highest - p.lowest) for p, s in zip(effect.parameters, shares, strict=True)
        ]
        model = effect.apply(model, values)
    judged = _likelihood(rate, line).judge(model)
    if judged is not None:
        assert all(np.isfinite(one.z).all() and np.isfinite(one.log_sigma) for one in judged)


@pytest.mark.parametrize("r", [0.4, 1.0])
def test_faster_waves_get_fewer_cells(r: float) -> None:
    effect = sized("bulk_modulus", r=r)
    faster: EffectiveModel = effect.effect.apply(MODELS["wave"], effect.values)
    stable = in_stable_cells(faster, 10e-6, 100e6)
    assert stable is not None
    assert stable.injector.line.cells < faster.injector.line.cells  # type: ignore[operator]
    assert stable.coefficients.line.strain(10e-6) < STABLE
    assert _likelihood(100e3, "wave").judge(faster) is not None


def test_cells_that_are_stable_stay() -> None:
    assert in_stable_cells(MODELS["wave"], 10e-6, 100e6) is MODELS["wave"]
    assert in_stable_cells(MODELS["lump"], 10e-6, 100e6) is MODELS["lump"]
