"""report.html: one page that stands alone and says what findings.json says."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest

from observer_rt.engine.estimation.phases import Phase
from observer_rt.engine.reports.learned_laws import LearnedLaw
from observer_rt.identification.discovery.findings import ModelSource
from observer_rt.identification.discovery.report.page import report
from observer_rt.identification.discovery.search.candidates import Candidate, Hypothesis
from observer_rt.identification.discovery.search.results import Decisive, LargestMisfit, Verdict
from observer_rt.identification.likelihood.signals import Signal
from observer_rt.model.effect import Equation
from observer_rt.model.effects import VOCABULARY
from observer_rt.model.term_effect import term_effect
from observer_rt.model.terms.term import TermEquation
from tests.identification.discovery.conftest import Worn

VOID = {"meta", "br", "path", "use", "rect", "line"}


class _Page(HTMLParser):
    """The text of a page; fails on tags that do not match, and notes what a browser would load or run."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.text = ""
        self.loaded: list[str] = []
        self._open: list[str] = []
        self.feed(page)
        assert not self._open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag in ("script", "link", "img", "iframe", "object"):
            self.loaded.append(tag)
        for name, value in attrs:
            outside = value is not None and re.search(r"(https?:|//|url\((?!#))", value)
            if outside and not name.startswith("xmlns"):
                self.loaded.append(f"{name}={value}")
        if tag not in VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self._open.pop()

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def _page(worn: Worn, **changes: Any) -> _Page:
    return _Page(report(replace(worn.findings, **changes)))


def test_the_page_stands_alone_with_size_confidence_and_amended_model_first(worn: Worn) -> None:
    page = _page(worn, judged_in_part=("long.csv: 113 of 988 complete injections chosen",))
    (effect,) = worn.findings.effects
    answer = page.text[: page.text.index("Where model and measurement disagree")]
    for said in (f"v_H = {effect.parameters['v_H'].value:.4f}", "confidence 0.96", "mg", "amended.toml"):
        assert said in answer
    for name in (*worn.task.hashes, "113 of 988"):
        assert name in page.text  # <0>.csv: shown, not taken for a tag
    assert page.loaded == []


def test_what_the_network_learned_is_the_first_figure_and_a_law_of_two_inputs_leads(worn: Worn) -> None:
    inputs, names = np.linspace(10.0, 100.0, 5), ("pressure_drop_MPa", "time_since_opening_ms")
    change, half, seen = 1e-3 * np.outer(inputs, inputs), np.full((5, 5), 0.01), np.eye(5, dtype=bool)
    curve = LearnedLaw("orifice_area", names[:1], (inputs,), change[0], half[0], seen[0], 0.97)
    surface = LearnedLaw("seat_area", names, (inputs, inputs), change, half, seen, 0.6)
    for learned, over in (((curve,), "sac_pressure"), ((curve, surface), "sac_pressure and time_since_opening")):
        findings = replace(worn.findings, learned=learned)
        first = report(findings).partition("</figure>")[0]
        assert "pressure drop [MPa], nozzle" in first
        assert f" over {over}." in first
        assert findings.as_json()["learned"] == [law.columns for law in learned]


def test_effects_and_laws_of_a_candidate_are_set_apart(worn: Worn) -> None:
    law = term_effect(TermEquation.NOZZLE_FLOW, "needle_lift/max_lift")
    together = Candidate(
        Hypothesis((VOCABULARY["orifice_area"], law)), (0.1, -0.2), 0.0, half=(0.01, 0.01), sizes_of_half=(0.1, -0.2)
    )
    text = _page(worn, ranking=(*worn.findings.ranking, together)).text
    assert "orifice_area + nozzle_flow = c * " in text


def test_names_of_files_are_text(worn: Worn) -> None:
    """Whatever the user called them, nothing of them is run."""
    name = "<script>alert('1')</script>&amp;.toml"
    page = _page(
        worn,
        model=ModelSource(name, "0" * 64, (name,)),
        recordings={name: "0" * 64},
        healthy=(name,),
        files=(name,) * 4,
        points=tuple(f"{name} {number}" for number in range(4)),
        amended_model=name,
        healthy_warning=name,
    )
    assert page.loaded == []
    assert page.text.count(name) > 10


def test_an_ambiguous_answer_names_its_rivals_and_what_would_decide(worn: Worn) -> None:
    rival = next(
        one for one in worn.findings.ranking if len(one.named) == 1 and not one.terms and one.ids[0] != "orifice_area"
    )
    tied: dict[str, Any] = {
        "verdict": Verdict.AMBIGUOUS,
        "rivals": (rival.ids,),
        "decide_by": (Decisive("a measurement at 160 MPa", ("orifice_area", *rival.ids)),),
    }
    text = _page(worn, **tied, amended_model=None).text
    assert f"Ambiguous: orifice_area, or {rival.ids[0]} (" in text
    assert "a measurement at 160 MPa" in text
    assert f"--choose orifice_area or --choose {rival.ids[0]}, and --force" in text
    assert "amended.toml" not in text
    chosen = _page(worn, **tied, chosen=("orifice_area",)).text
    assert "amended.toml" in chosen
    assert "--choose" not in chosen


@pytest.mark.parametrize("verdict", [Verdict.NONE, Verdict.UNKNOWN])
def test_without_an_effect_no_model_is_promised(worn: Worn, verdict: Verdict) -> None:
    is_unknown = verdict is Verdict.UNKNOWN
    nominal = next(one for one in worn.findings.ranking if not one.ids)
    position = LargestMisfit(
        Equation.SAC_PRESSURE, Phase.CLOSING, Signal.LINE_PRESSURE, ("duration",), "measured < modelled"
    )
    text = _page(
        worn,
        verdict=verdict,
        named=nominal,
        best=worn.findings.named if is_unknown else nominal,
        effects=(),
        unexplained=position if is_unknown else None,
        amended_model=None,
    ).text
    assert "amended.toml" not in text
    assert ("while the needle closes" in text) == is_unknown
    assert ("nearest, and not enough: orifice_area" in text) == is_unknown
    assert text.count("Model as given") == 1
    assert "On operating points" not in text  # nothing was fitted


def test_one_operating_point_is_said_in_the_headline_and_nowhere_denied(worn: Worn) -> None:
    text = _page(worn, held_out=worn.findings.fitted_on).text
    assert "nothing held out" in text[: text.index("The gap, by")]
    assert not re.search("held out:|judged on the others|every second", text)
    assert "judged on the others" in _page(worn).text
