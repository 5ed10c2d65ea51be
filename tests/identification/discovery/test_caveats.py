"""What must be kept in mind with an answer, in the same words everywhere."""

from dataclasses import replace

import pytest

from observer_rt.engine.estimation.phases import Phase
from observer_rt.identification.discovery.caveats import Caveat, is_level_measured, is_like_inertance
from observer_rt.identification.discovery.discover import DiscoveryTask, answer
from observer_rt.identification.discovery.findings import Findings
from observer_rt.identification.discovery.injections import RATE
from observer_rt.identification.discovery.report.text import as_text
from observer_rt.identification.discovery.search.candidates import Size
from observer_rt.identification.discovery.search.results import Verdict
from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.model.effects import effective_model, sized
from tests.baselines import baseline
from tests.identification.discovery.conftest import Worn
from tests.identification.discovery.hidden import NOMINAL, recordings


def _by_id(findings: Findings) -> dict[str, Caveat]:
    return {caveat.id: caveat for caveat in findings.caveats}


def test_good_recordings_leave_no_reservation(worn: Worn) -> None:
    assert worn.findings.caveats == ()
    assert as_text(worn.findings).splitlines()[0].endswith("(confidence 0.96)")


def _without_rate(findings: Findings) -> Findings:
    others = {name: gap for name, gap in findings.gaps.by_name.items() if name != RATE}
    return replace(findings, gaps=replace(findings.gaps, by_name=others))


def _slow_lift_sensor(findings: Findings) -> Findings:
    lag = {"tau": Size(value=16.0, ci95=(15.0, 17.0), unit="us")}
    return replace(findings, effects=(replace(findings.effects[0], id="needle_lift_sensor_lag", parameters=lag),))


@pytest.mark.parametrize(
    ("caveat", "changed"),
    [
        ("bench_file", _slow_lift_sensor),
        ("one_operating_point", lambda f: replace(f, held_out=f.fitted_on)),
        ("one_rail_pressure", lambda f: replace(f, before=tuple(replace(c, rail_pressure=60e6) for c in f.before))),
        ("mass_not_measured", _without_rate),
        ("line_inertance", lambda f: _without_rate(replace(f, like_inertance=True))),
        ("healthy_recordings", lambda f: replace(f, healthy_warning="the model is another")),
    ],
)
def test_a_reservation_is_in_headline_and_document(worn: Worn, caveat: str, changed: object) -> None:
    assert callable(changed)
    findings = changed(worn.findings)
    (only_caveat,) = findings.caveats
    assert only_caveat.id == caveat
    assert f"but: {only_caveat.words}" in as_text(findings).splitlines()[0]
    assert vars(only_caveat) in findings.as_json()["caveats"]


def test_a_measured_rate_settles_the_inertance(worn: Worn) -> None:
    assert replace(worn.findings, like_inertance=True).caveats == ()


def test_a_level_measured_when_the_model_was_fitted_settles_masses(worn: Worn) -> None:
    measured = replace(_without_rate(worn.findings), level_measured=True)
    assert measured.caveats == ()
    (caveat,) = replace(measured, like_inertance=True).caveats
    assert "when the model was fitted" in caveat.sentence


@pytest.mark.parametrize(("level", "measured"), [("file", False), ("measured_mass", True), ("measured_rate", True)])
def test_the_level_is_what_the_fit_of_the_model_says(level: str, measured: bool) -> None:
    assert not is_level_measured(effective_model(NOMINAL))
    fitted = NOMINAL.model_copy(update={"baseline": baseline(level=level)})
    assert is_level_measured(effective_model(fitted)) is measured


def test_what_looks_the_same_in_every_signal_is_told(worn: Worn) -> None:
    (effect,) = worn.findings.effects
    stiffer = replace(effect, id="bulk_modulus", indistinguishable_from=("line_volume", "entrained_air"))
    caveats = _by_id(replace(worn.findings, effects=(stiffer,)))
    assert caveats["same_signals"].words == "line_volume would look the same"


def test_nothing_is_said_of_masses_nobody_believes(worn: Worn) -> None:
    unknown = replace(worn.findings, verdict=Verdict.UNKNOWN, effects=())
    assert _by_id(_without_rate(unknown)) == {}


@pytest.mark.parametrize(("v_h", "r", "alike"), [(0.2, -1 / 6, True), (0.2, 0.0, False), (0.2, 0.2, False)])
def test_flow_and_stiffness_changed_together_look_like_another_inertance(v_h: float, r: float, alike: bool) -> None:
    amended = effective_model(NOMINAL, (sized("orifice_area", v_H=v_h), sized("bulk_modulus", r=r)))
    assert is_like_inertance(effective_model(NOMINAL), amended) is alike


def test_a_model_that_leaves_many_times_the_noise_explains_nothing(worn: Worn) -> None:
    """Whatever the healthy injector left, too: in the innovations, or with nothing corrected."""
    nothing = replace(worn.findings, verdict=Verdict.NONE, effects=())
    assert "mass_not_measured" in _by_id(_without_rate(nothing))
    quiet = tuple(replace(cell, variance=1.0) for cell in nothing.before)
    gaps = {name: replace(gap, before=gap.noise_floor) for name, gap in nothing.gaps.by_name.items()}
    explained = replace(nothing, before=quiet, gaps=replace(nothing.gaps, by_name=gaps))
    assert as_text(explained).startswith("none: the model explains the recordings")
    far = {name: replace(gap, before=5.0 * gap.noise_floor) for name, gap in gaps.items()}
    loud = (replace(quiet[0], phase=Phase.OPEN, rail_pressure=140e6, variance=25.0), *quiet[1:])
    for findings in (replace(explained, before=loud), replace(explained, gaps=replace(nothing.gaps, by_name=far))):
        headline = as_text(findings).splitlines()[0]
        assert "does not explain the recordings: it leaves 5.0 times the noise, most in the line pressure" in headline
    assert "while the needle is open at 140 MPa" in as_text(replace(explained, before=loud))


def test_what_is_of_the_bench_is_told_and_never_amended() -> None:
    made = recordings((sized("needle_lift_sensor_lag", tau=16e-6),))
    task = DiscoveryTask(NOMINAL, measurements(made), (), {"a.csv": "0" * 64, "b.csv": "1" * 64})
    findings = answer(task, lambda _: None)
    assert [effect.id for effect in findings.effects] == ["needle_lift_sensor_lag"]
    assert "state the lag of the lift sensor in the bench file" in as_text(findings).splitlines()[0]
    assert (findings.amended_model, findings.in_force) == (None, ())
