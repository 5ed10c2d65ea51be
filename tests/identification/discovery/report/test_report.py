"""report.html: one page that stands alone and says what findings.json says."""

import re
from collections.abc import Mapping
from dataclasses import replace
from html.parser import HTMLParser
from typing import Any

import pytest

from observer_rt.engine.estimation.phases import Phase
from observer_rt.identification.discovery.findings import Sources
from observer_rt.identification.discovery.report.page import report
from observer_rt.identification.discovery.search.results import Decisive, Discovery, Unexplained, Verdict
from observer_rt.identification.likelihood.likelihood import Signal
from observer_rt.model.effect import Equation
from tests.identification.discovery.conftest import SOURCES, Worn

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


def _page(worn: Worn, found: Discovery | None = None, **changes: Any) -> _Page:
    findings = replace(worn.findings, **changes)
    if found is not None:
        findings = replace(findings, discovery=found)
    return _Page(report(findings, _sources(worn.task.hashes)))


def _sources(hashes: Mapping[str, str]) -> Sources:
    return replace(SOURCES, recordings=hashes)


def test_the_page_stands_alone(worn: Worn) -> None:
    assert _page(worn).loaded == []


def test_names_of_files_are_text(worn: Worn) -> None:
    """Whatever the user called them, nothing of them is run."""
    name = "<script>alert('1')</script>&amp;.toml"
    sources = replace(_sources({name: "0" * 64}), model=name, healthy=(name,), in_force=(name,))
    points = tuple(f"{name} {number}" for number in range(4))
    findings = replace(
        worn.findings, files=(name,) * 4, points=points, amended_model=name, healthy_warning=name
    )
    page = _Page(report(findings, sources))
    assert page.loaded == []
    assert page.text.count(name) > 10


def test_the_answer_comes_first_with_size_confidence_and_consequences(worn: Worn) -> None:
    text = _page(worn).text
    (effect,) = worn.findings.effects
    answer = text[: text.index("Where model and measurement disagree")]
    assert f"v_H = {effect.parameters[0].value:.4f}" in answer
    assert "99%" in answer
    assert re.search(r"[\d.]+ MPa off in line pressure and [\d.]+ mg \([\d.]+%\) in injected mass", answer)
    assert "amended.toml" in answer


def test_a_recording_judged_in_part_is_told(worn: Worn) -> None:
    words = "long.csv: 113 of 988 complete injections chosen"
    assert words not in _page(worn).text
    assert f"{words}." in _page(worn, in_part=(words,)).text
    told = replace(worn.findings, in_part=(words,)).as_json()["judged_in_part"]
    assert (worn.findings.as_json()["judged_in_part"], told) == ([], [words])


def test_every_part_is_there(worn: Worn) -> None:
    page = _page(worn)
    for heading in (
        "Where model and measurement disagree",
        "A typical injection",
        "not fitted to",
        "Candidates and their evidence",
        "could not be told apart",
        "at standstill",
        "How this was found",
    ):
        assert heading in page.text
    for name in worn.task.hashes:
        assert name in page.text  # <0>.csv: shown, not taken for a tag


def test_an_ambiguous_answer_names_its_rivals_and_what_would_decide(worn: Worn) -> None:
    rival = next(one for one in worn.findings.ranking if len(one.ids) == 1 and one.ids[0] != "orifice_area")
    found = replace(
        worn.findings.discovery,
        verdict=Verdict.AMBIGUOUS,
        rivals=(rival.ids,),
        decide_by=(Decisive("a measurement at 160 MPa", ("orifice_area", *rival.ids)),),
    )
    text = _page(worn, found, amended_model=None).text
    headline = text[: text.index("Without any of this")]
    assert "orifice area, v_H = " in headline
    assert f"; or {rival.ids[0].replace('_', ' ')}, " in headline
    assert "do not decide" in headline
    assert f"explained as well by: {rival.ids[0]}" in text
    assert "a measurement at 160 MPa" in text
    assert f"--choose orifice_area or --choose {rival.ids[0]}, and --force" in text
    assert "amended.toml" not in text
    chosen = _page(worn, found, chosen=("orifice_area",)).text
    assert "as was chosen" in chosen
    assert "amended.toml" in chosen
    assert "--choose" not in chosen


@pytest.mark.parametrize("verdict", [Verdict.NONE, Verdict.UNKNOWN])
def test_without_an_effect_no_model_is_promised(worn: Worn, verdict: Verdict) -> None:
    nominal = next(one for one in worn.findings.ranking if not one.ids)
    place = Unexplained(
        Equation.SAC_PRESSURE, Phase.CLOSING, Signal.LINE_PRESSURE, ("duration",), "measured < modelled"
    )
    found = replace(
        worn.findings.discovery,
        verdict=verdict,
        named=nominal,
        best=nominal if verdict is Verdict.NONE else worn.findings.named,
        effects=(),
        unexplained=place if verdict is Verdict.UNKNOWN else None,
    )
    text = _page(worn, found, amended_model=None).text
    assert "amended.toml" not in text
    assert ("Nothing is missing" in text) == (verdict is Verdict.NONE)
    assert ("while the needle closes" in text) == (verdict is Verdict.UNKNOWN)
    assert ("Measured < modelled; nearest, and not enough: orifice_area" in text) == (
        verdict is Verdict.UNKNOWN
    )
    assert ("Nearest, not enough: orifice_area" in text) == (verdict is Verdict.UNKNOWN)
    assert "On operating points" not in text  # nothing was fitted
    assert "How far off the model is" in text
    assert text.count("Model as given") == 1


def test_one_operating_point_is_said_in_the_headline_and_nowhere_denied(worn: Worn) -> None:
    page = _page(worn, held_out=worn.findings.fitted_on)
    headline = page.text[: page.text.index("Without it")]
    assert "But: one operating point, nothing held out" in headline
    for denied in (
        "On operating points the",
        "other operating points than",
        "judged on the others",
        "every second",
    ):
        assert denied not in page.text
    assert "nothing is held out" in page.text
    held_apart = _page(worn).text
    assert "one operating point" not in held_apart
    assert "other operating points than these" in held_apart
