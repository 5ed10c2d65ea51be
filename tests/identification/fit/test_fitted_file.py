"""The fitted file: the numbers in it, all else as it was, and taken back."""

from pathlib import Path

import pytest
import tomlkit

from observer_rt.config.bench import NOMINAL_INJECTOR, load_injector
from observer_rt.config.injector_file import InjectorFile
from observer_rt.foundation.errors import UserError
from observer_rt.identification.fit.calibrate import CalibrationResult, calibrate
from observer_rt.identification.fit.fitted_file import baseline_of, write_fitted
from observer_rt.identification.fit.forms import STRUCTURES
from observer_rt.identification.likelihood.measurement import measurements
from tests.identification.fit.healthy import NOMINAL, off_by_ten_percent, simulations

SEAT_LUMP = tuple(one for one in STRUCTURES if one.line == "lump")[1:]
TWO_PARTS = tuple(one for one in STRUCTURES if one.line == "wave_two_part")[:1]
FOUND = measurements([one.recording for one in simulations([(60e6, 0.6e-3), (140e6, 1.9e-3)], injections=2)])
HASHES = {"a.csv": "0123456789abcdef"}


@pytest.fixture(
    scope="module",
    params=[pytest.param(SEAT_LUMP, id="lump"), pytest.param(TWO_PARTS, id="two folds", marks=pytest.mark.slow)],
)
def done(request: pytest.FixtureRequest) -> CalibrationResult:
    """Two recordings in a structure that is not the file's."""
    return calibrate(off_by_ten_percent(), FOUND, {}, lambda _: None, request.param)


def _written(done: CalibrationResult, source: Path, path: Path) -> None:
    write_fitted(path, InjectorFile.read(source), done, baseline_of(done, HASHES))


def test_the_file_is_taken_back_as_it_was_fitted(done: CalibrationResult, tmp_path: Path) -> None:
    _written(done, NOMINAL_INJECTOR, tmp_path / "fitted.toml")
    back = load_injector(tmp_path / "fitted.toml")
    assert back.line_outflow is done.fitted.structure.outflow
    assert (back.line.model, back.line.cells) == (done.fitted.structure.line, done.injector.line.cells)
    for parameter in done.fitted.calibration.free:
        assert parameter.of(back) == pytest.approx(parameter.of(done.injector), rel=1e-6)
    assert back.baseline == baseline_of(done, HASHES)


def test_comments_and_what_was_not_fitted_stay(done: CalibrationResult, tmp_path: Path) -> None:
    _written(done, NOMINAL_INJECTOR, tmp_path / "fitted.toml")
    before, after = NOMINAL_INJECTOR.read_text().splitlines(), (tmp_path / "fitted.toml").read_text()
    assert all(line.partition("#")[2] in after for line in before)
    assert load_injector(tmp_path / "fitted.toml").seat.diameter == NOMINAL.seat.diameter


def test_a_fitted_file_is_fitted_again(done: CalibrationResult, tmp_path: Path) -> None:
    """What an earlier fit wrote is replaced, not added to."""
    first, second = tmp_path / "first.toml", tmp_path / "second.toml"
    _written(done, NOMINAL_INJECTOR, first)
    _written(done, first, second)
    assert tomlkit.parse(second.read_text()) == tomlkit.parse(first.read_text())


def test_a_structure_of_one_part_has_no_ratio_of_two(tmp_path: Path) -> None:
    two_part = tmp_path / "two_part.toml"
    text = NOMINAL_INJECTOR.read_text().replace(
        "[line]\n", '[line]\nmodel = "wave_two_part"\nimpedance_ratio = 0.8\ncells = 10\n'
    )
    two_part.write_text(text)
    again = calibrate(load_injector(two_part), FOUND[:1], {}, lambda _: None, SEAT_LUMP)
    _written(again, two_part, tmp_path / "fitted.toml")
    line = load_injector(tmp_path / "fitted.toml").line
    assert (line.model, line.impedance_ratio, line.cells) == ("lump", None, None)


def test_a_file_that_is_no_toml_is_named(tmp_path: Path) -> None:
    path = tmp_path / "broken.toml"
    path.write_text("[line\n")
    with pytest.raises(UserError, match=r"broken\.toml"):
        InjectorFile.read(path)
