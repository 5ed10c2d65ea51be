"""Effects of the user's own: in the vocabulary when they are sound, refused with file and remedy when not."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from observer_rt.config.bench import load_injector
from observer_rt.config.own_effects import use_effects
from observer_rt.foundation.errors import UserError
from observer_rt.identification.discovery.search.candidates import problem_key
from observer_rt.identification.discovery.search.search import indistinguishable, representatives
from observer_rt.identification.discovery.search.verdict import decide_by
from observer_rt.model.effects import VOCABULARY, effective_model, sized

HEAD = """from observer_rt.model.effect import *
from observer_rt.model.effective import EffectiveModel

"""
SOUND = """EFFECT = Effect(
    id="sac_volume",
    place=Place.SAC,
    parameters=(parameter("r", -0.5, 4.0, 0.02, unit="%", si=0.01),),
    apply=scaled("nozzle", "sac_volume"),
    sentence="The sac is larger.",
    signature="Later.",
    relations=(Relation(("seat_area",), Likeness.SAME, "a gauge in the sac"),),
)
"""
NOMINAL = load_injector()


@pytest.fixture(autouse=True)
def vocabulary_as_it_was() -> Iterator[None]:
    yield
    use_effects(())


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """A sound file."""
    path = tmp_path / "my_effects.py"
    path.write_text(HEAD + SOUND)
    return path


def test_it_is_an_effect_like_any_other(own: Path) -> None:
    before = list(VOCABULARY)
    use_effects([own])
    assert list(VOCABULARY) == [*before, "sac_volume"]
    larger = effective_model(NOMINAL, (sized("sac_volume", r=0.02),))
    assert larger.injector.nozzle.sac_volume == pytest.approx(1.02 * NOMINAL.nozzle.sac_volume)
    (decisive,) = decide_by(("seat_area", "sac_volume"))
    assert decisive.measurement == "a gauge in the sac"
    # one of two states the relation, and it holds for both
    assert indistinguishable(VOCABULARY["seat_area"]) == ("sac_volume",)
    assert VOCABULARY["sac_volume"] not in representatives()
    use_effects(())
    assert list(VOCABULARY) == before


def test_several_in_several_files(own: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.py"
    one, two = (SOUND.replace('id="sac', f'id="{name}') for name in ("first", "next"))
    other.write_text(HEAD + one + two.replace("EFFECT", "NEXT"))
    use_effects([own, other])
    assert {"sac_volume", "first_volume", "next_volume"} <= set(VOCABULARY)


def test_what_was_fitted_is_kept_for_this_file_only(own: Path) -> None:
    keys = {problem_key(NOMINAL, [])}
    for dead_zone in ("0.02", "0.03"):
        own.write_text(own.read_text().replace("0.02", dead_zone))
        use_effects([own])
        keys.add(problem_key(NOMINAL, []))
    assert len(keys) == 3


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('id="sac_volume"', 'id="sac volume"', "small letters"),
        ('id="sac_volume"', 'id="seat_area"', "'seat_area' is an effect already"),
        ('id="sac_volume"', "id=7", "cannot be used"),
        ("Place.SAC", '"saq"', "Place.SAC"),
        ("Place.SAC", "Place.SAQ", "my_effects.py:6: does not run"),
        ('"The sac is larger."', '""', "no sentence"),
        ("si=0.01),)", "si=0.01))", "with the comma"),
        ("-0.5, 4.0", "4.0, -0.5", "lowest first"),
        ("-0.5, 4.0", "1.0, 4.0", "out of bounds"),
        ("-0.5, 4.0", "-0.5, float('inf')", "finite bounds"),
        ("0.02,", "0.02, (9.0,),", "out of bounds"),
        ("0.02,", "0.0,", "dead zone"),
        ("si=0.01", "si=0.0", "above 0"),
        ('unit="%"', 'unit=""', "no unit"),
        ('parameter("r"', 'parameter("r", -1.0, 1.0, 0.1), parameter("r"', "two parameters of one name"),
        ("-0.5, 4.0", "-150.0, 4.0", "apply at r = -150 %: fails"),
        ('"sac_volume")', '"sack_volume")', "apply at r = -0.5 %: fails"),
        ('scaled("nozzle", "sac_volume")', "lambda model, values: None", "not an EffectiveModel"),
        ('scaled("nozzle", "sac_volume")', "lambda model, values: model", "changes nothing"),
        (
            'scaled("nozzle", "sac_volume")',
            "lambda m, v: m.with_section('line', volume=1.1 + v[0])",
            "changes a model at the 'off' values",
        ),
        (
            'scaled("nozzle", "sac_volume")',
            "lambda m, v: m.with_terms('sensor', offset=v[0] * float('inf'))",
            "not finite",
        ),
        ('"seat_area"', '"seat_aria"', "the nearest is 'seat_area'"),
        ('"seat_area"', '"sac_volume"', "no other effect"),
        ("EFFECT = Effect(", "EFFECT = dict(", "defines no effect"),
        ("EFFECT = Effect(", "EFFECT = Effect)", "my_effects.py:4: does not run"),
        ("EFFECT = Effect(", "raise SystemExit\nEFFECT = Effect(", "my_effects.py:4: does not run"),
    ],
)
def test_mistakes_are_named(own: Path, old: str, new: str, said: str) -> None:
    before = dict(VOCABULARY)
    text = own.read_text()
    assert text.count(old) == 1
    own.write_text(text.replace(old, new))
    with pytest.raises(UserError) as refused:
        use_effects([own])
    assert "my_effects.py" in refused.value.place
    assert refused.value.remedy
    assert said in str(refused.value)
    assert dict(VOCABULARY) == before


@pytest.mark.parametrize("name", ["nope.py", "folder", "effects.txt"])
def test_no_python_file(tmp_path: Path, name: str) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "effects.txt").write_text(HEAD + SOUND)
    with pytest.raises(UserError, match=r"is no Python file(?s:.*)docs/effects.md"):
        use_effects([tmp_path / name])


def test_a_file_given_twice(own: Path) -> None:
    with pytest.raises(UserError, match="every file once"):
        use_effects([own, own])


@pytest.mark.parametrize(
    ("value", "listed"), [("their_effects", 0), ("their_effects:EFFECT", 0), ("their_effects:NONE", 2)]
)
def test_an_installed_package_brings_its_effects(tmp_path: Path, value: str, listed: int) -> None:
    (tmp_path / "their_effects.py").write_text(HEAD + SOUND)
    package = tmp_path / "theirs-1.0.dist-info"
    package.mkdir()
    (package / "METADATA").write_text("Metadata-Version: 2.1\nName: theirs\nVersion: 1.0\n")
    (package / "entry_points.txt").write_text(f"[observer_rt.effects]\nsacs = {value}\n")
    code = (
        f"import sys; sys.path.append({str(tmp_path)!r}); from observer_rt.desk.cli.app import main; main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "effects"], capture_output=True, text=True, check=False
    )
    assert done.returncode == listed, done.stderr
    assert ("The sac is larger." in done.stdout) == (listed == 0)
    assert ("installed effects 'sacs'" in done.stderr) == (listed != 0)


BOUNDED = """from observer_rt.model.effect import bounded
from observer_rt.model.effects import BUILT_IN

VOLUME = BUILT_IN["line_volume"]
"""


def test_an_effect_of_the_vocabulary_within_other_bounds(own: Path) -> None:
    order, key = list(VOCABULARY), problem_key(NOMINAL, [])
    own.write_text(BOUNDED + "LESS = bounded(VOLUME, r=(-0.2, 0.1))\n")
    use_effects([own])
    (parameter,) = VOCABULARY["line_volume"].parameters
    assert (parameter.lowest, parameter.highest) == (-0.2, 0.1)
    assert parameter.starts == (-0.2, -0.13, 0.0, 0.1)
    assert list(VOCABULARY) == order
    assert problem_key(NOMINAL, []) != key  # what was fitted within the other bounds is not taken over
    assert indistinguishable(VOCABULARY["bulk_modulus"]) == ("line_volume",)


def test_bounds_are_in_printed_units(own: Path) -> None:
    own.write_text(BOUNDED.replace("line_volume", "channel_skew") + "MORE = bounded(VOLUME, d=(-90, 90))\n")
    use_effects([own])
    (parameter,) = VOCABULARY["channel_skew"].parameters
    assert (parameter.lowest, parameter.highest) == pytest.approx((-90e-6, 90e-6))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("LESS = bounded(VOLUME, v=(-0.2, 0.1))", "line_volume has no parameter v"),
        ("LESS = bounded(VOLUME, r=(0.1, 0.2))", "out of bounds"),
        ("LESS = bounded(VOLUME, r=(-2.0, 0.1))", "apply at r = -2"),
        (
            "from dataclasses import replace\nOTHER = replace(bounded(VOLUME, r=(-0.2, 0.1)), sentence='Mine.')",
            "is an effect already",
        ),
        ("ONE, TWO = bounded(VOLUME, r=(-0.2, 0.1)), bounded(VOLUME, r=(-0.2, 0.2))", "is an effect already"),
    ],
)
def test_bounds_that_will_not_do(own: Path, text: str, message: str) -> None:
    own.write_text(BOUNDED + text + "\n")
    with pytest.raises(UserError, match=message):
        use_effects([own])
