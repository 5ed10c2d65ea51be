"""`[[effects]]` of an injector file: read, put in force, refused with key and remedy."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from observer_rt.config.bench import NOMINAL_INJECTOR, load_injector
from observer_rt.daemon.state_file import model_hash
from observer_rt.model.effect import Effect
from observer_rt.model.effects import VOCABULARY, effective_model, sized
from tests.config.test_bench import require_refusal

ERODED = """
[[effects]]
id = "orifice_area"
parameters = { v_H = { value = 0.30, ci95 = [0.29, 0.31], unit = "-" } }
origin = "discover"
evidence = "six recordings"
date = 2026-01-31
"""
LATE = """
[[effects]]
id = "channel_skew"
parameters = { d = { value = 12.5, unit = "us" } }
"""
SWITCH = '\n[[effects]]\nid = "seat_outflow"\n'


def injector_file(folder: Path, end: str) -> Path:
    path = folder / "injector.toml"
    path.write_text(NOMINAL_INJECTOR.read_text() + end)
    return path


def test_effects_are_read_and_in_force(tmp_path: Path) -> None:
    injector = load_injector(injector_file(tmp_path, ERODED + LATE + SWITCH))
    eroded, late, switch = injector.effects
    assert (eroded.origin, eroded.evidence, eroded.date) == ("discover", "six recordings", "2026-01-31")
    assert eroded.parameters["v_H"].ci95 == (0.29, 0.31)
    assert (late.origin, late.date, switch.parameters) == ("", "", {})
    expected = [sized("orifice_area", v_H=0.3), sized("channel_skew", d=12.5e-6), sized("seat_outflow")]
    model = effective_model(injector)
    by_hand = effective_model(load_injector(), expected)
    assert model.coefficients == by_hand.coefficients
    assert model.sensor == pytest.approx(by_hand.sensor)
    assert model.injector == by_hand.injector
    assert model.injector.effects == ()  # so that nothing is applied twice


def test_example_in_the_shipped_file_is_one(tmp_path: Path) -> None:
    head, example = NOMINAL_INJECTOR.read_text().split("# [[effects]]")
    lines = [line.removeprefix("# ") for line in example.splitlines()]
    path = tmp_path / "injector.toml"
    path.write_text(head + "\n[[effects]]" + "\n".join(lines) + "\n")
    (effect,) = load_injector(path).effects
    assert effect.id == "orifice_area"


@pytest.mark.parametrize(
    ("old", "new", "key", "said"),
    [
        ('"orifice_area"', '"orifice_aria"', "0.id", "'orifice_area'"),
        ("v_H =", "v_S =", "0.parameters.v_S", "v_H"),
        ('unit = "-"', 'unit = "%"', "0.parameters.v_H.unit", "'-'"),
        (', unit = "-"', "", "0.parameters.v_H.unit", "add it"),
        ("0.30", "7.0", "0.parameters.v_H.value", "-0.8 to 1.5"),
        ("0.30", "nan", "0.parameters.v_H.value", "should be a finite number"),
        ("ci95 =", "ci =", "0.parameters.v_H.ci", "did you mean 'ci95'?"),
        ("origin =", "origins =", "0.origins", "did you mean 'origin'?"),
        ("[0.29, 0.31]", "[0.29]", "0.parameters.v_H.ci95.1", "add it"),
        ('parameters = { v_H = { value = 0.30, ci95 = [0.29, 0.31], unit = "-" } }', "", "0", "v_H"),
        ('id = "orifice_area"', "", "0.id", "add it"),
    ],
)
def test_mistakes_name_the_key(tmp_path: Path, old: str, new: str, key: str, said: str) -> None:
    assert ERODED.count(old) == 1
    require_refusal(load_injector, injector_file(tmp_path, ERODED.replace(old, new)), f"effects.{key}", said)


SLOW = '\n[[effects]]\nid = "needle_lift_sensor_lag"\nparameters = { tau = { value = 16.0, unit = "us" } }\n'


@pytest.mark.parametrize(
    ("text", "number", "said"),
    [(ERODED + LATE + ERODED, 2, "twice"), (SLOW, 0, "lag of the lift sensor in the bench file")],
)
def test_an_effect_given_twice_or_of_the_bench(tmp_path: Path, text: str, number: int, said: str) -> None:
    require_refusal(load_injector, injector_file(tmp_path, text), f"effects.{number}.id", said)


@settings(max_examples=30)
@given(st.sampled_from([e for e in VOCABULARY.values() if e.parameters and not e.remedy]), st.floats(0.0, 1.0))
def test_every_effect_in_its_unit(tmp_path_factory: pytest.TempPathFactory, effect: Effect, share: float) -> None:
    values = [p.lowest + share * (p.highest - p.lowest) for p in effect.parameters]
    printed = ", ".join(
        f'{p.name} = {{ value = {value / p.si!r}, unit = "{p.unit}" }}'
        for p, value in zip(effect.parameters, values, strict=True)
    )
    text = f'\n[[effects]]\nid = "{effect.id}"\nparameters = {{ {printed} }}\n'
    model = effective_model(load_injector(injector_file(tmp_path_factory.mktemp("effects"), text)))
    sizes = {p.name: value for p, value in zip(effect.parameters, values, strict=True)}
    by_hand = effective_model(load_injector(), [sized(effect.id, **sizes)])
    for actual, expected in (
        *zip(model.coefficients, by_hand.coefficients, strict=True),  # of an element, or a number
        (model.inputs, by_hand.inputs),
        (model.sensor, by_hand.sensor),
    ):
        assert actual == pytest.approx(expected, rel=1e-9)


def test_model_hash_covers_what_effects_do_and_not_why_they_are_believed(tmp_path: Path) -> None:
    def hashed(effects: str) -> str:
        return model_hash(load_injector(injector_file(tmp_path, effects)))

    others = (model_hash(load_injector()), hashed(ERODED.replace("0.30", "0.31")), hashed(ERODED + LATE))
    believed = ERODED.replace("six recordings", "a dream").replace("2026", "2027")
    assert hashed(ERODED) not in others
    assert hashed(ERODED) == hashed(believed.replace("[0.29, 0.31]", "[0, 1]"))
