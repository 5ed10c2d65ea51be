"""What no vocabulary has: proposed as a law, put into the amended model, and what is left then."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from observer_rt.config.bench import NOMINAL_INJECTOR, load_injector
from observer_rt.config.injector_file import InjectorFile
from observer_rt.identification.discovery.amend import write_amended
from observer_rt.identification.discovery.discover import DiscoveryTask, answer
from observer_rt.identification.discovery.findings import Findings
from observer_rt.identification.discovery.report.document import document_of
from observer_rt.identification.discovery.report.page import report
from observer_rt.identification.discovery.report.text import as_text
from observer_rt.identification.discovery.search.candidates import NoMemory
from observer_rt.identification.discovery.search.results import Verdict
from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effects import effective_model, sized
from observer_rt.model.terms.parser import parse
from observer_rt.model.terms.term import Term, TermEquation
from tests.identification.discovery.conftest import SOURCES, WORN_POINTS, agrees
from tests.identification.discovery.hidden import NOMINAL, recordings
from tests.identification.discovery.terms import effect_of

PLUGGED = Term(
    TermEquation.NOZZLE_FLOW, parse("-0.2*(injection_number > 1)")
)  # a hole, after the first injection


def question_of(*effects: SizedEffect) -> DiscoveryTask:
    made = recordings(effects, points=WORN_POINTS)
    return DiscoveryTask(NOMINAL, measurements(made), (), {f"{n}.csv": f"{n:064x}" for n in range(len(made))})


def answered(task: DiscoveryTask) -> Findings:
    return answer(task, NoMemory(), agrees, lambda _: None, "amended.toml")


@pytest.fixture(scope="module")
def plugged() -> DiscoveryTask:
    return question_of(SizedEffect(effect_of(PLUGGED), ()))


@pytest.fixture(scope="module")
def accepted(plugged: DiscoveryTask) -> Findings:
    return answered(replace(plugged, accepted=1))


def test_what_no_effect_explains_is_proposed_as_a_law(accepted: Findings) -> None:
    found = accepted.discovery
    proposal = found.proposals[0]
    (term,) = proposal.terms
    low, high = term.interval or (0.0, 0.0)

    assert found.verdict is Verdict.UNKNOWN
    assert term.equation is TermEquation.NOZZLE_FLOW
    assert {variable.word for variable in term.law.variables} == {"injection_number"}
    assert low < -0.2 < high
    assert high - low < 0.01
    assert proposal.may_enter
    assert proposal.held_out[1] < 0.5 * proposal.held_out[0]


def test_a_law_is_drawn_beside_what_the_recordings_say(accepted: Findings) -> None:
    (curve,) = accepted.discovery.proposals[0].curves

    assert curve.words == "injection"
    np.testing.assert_array_equal(curve.at, (1.0, 2.0))
    np.testing.assert_allclose(curve.points, (0.0, -0.2), atol=0.01)
    assert np.all(curve.half < 0.02)
    assert "free curve" not in as_text(accepted)
    assert "may be any curve there" in report(accepted, SOURCES)


def test_an_accepted_proposal_explains_the_recordings(
    accepted: Findings, plugged: DiscoveryTask, tmp_path: Path
) -> None:
    path = tmp_path / "amended.toml"
    file = InjectorFile.read(NOMINAL_INJECTOR)
    write_amended(path, file, accepted.in_force, None, accepted.terms)

    amended = load_injector(path)
    again = answered(replace(plugged, parameters=amended))

    assert effective_model(amended).terms[0].coefficient == pytest.approx(-0.2, abs=0.01)
    assert accepted.amended_model == "amended.toml"
    assert again.discovery.verdict is Verdict.NONE


def test_a_proposal_is_in_every_answer(accepted: Findings) -> None:
    (stated,) = document_of(accepted, SOURCES).as_json()["unknown"]["proposals"]

    assert stated["terms"][0]["equation"] == "nozzle_flow"
    assert stated["terms"][0]["depends_on"] == ["injection_number"]
    assert stated["terms"][0]["hardly_told_from"] == ["chamber_pressure"]
    assert "hardly tells it from a law of chamber_pressure" in as_text(accepted)
    assert stated["gap_held_out"]["after_MPa"] < stated["gap_held_out"]["before_MPa"]
    for text in (as_text(accepted), report(accepted, SOURCES)):
        words = r"as if the nozzle lost (19\.\d|20|20\.\d) % of its flow from the injection after number 1 on"
        assert re.search(words, text)


@pytest.mark.parametrize(("number", "because"), [(2, "there are 1"), (7, "there are 1")])
def test_a_proposal_that_is_not_there_is_not_accepted(
    plugged: DiscoveryTask, number: int, because: str
) -> None:
    found = answered(replace(plugged, accepted=number))

    assert because in found.not_accepted
    assert found.amended_model is None
    assert found.terms == ()


@pytest.mark.parametrize("effects", [(), (sized("orifice_area", v_H=0.1),)])
def test_nothing_is_proposed_where_the_vocabulary_explains(effects: tuple[SizedEffect, ...]) -> None:
    found = answered(replace(question_of(*effects), accepted=1))

    assert found.discovery.proposals == ()
    assert "no such proposal" in found.not_accepted
    assert (found.amended_model is None) == (not effects)
