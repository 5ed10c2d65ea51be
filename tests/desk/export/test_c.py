"""C of an export: compiled without a warning, it does what the observer and the model here do, to the last digits."""

import re
import subprocess
from collections.abc import Mapping
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from elftools.elf.elffile import ELFFile

from observer_rt.config.bench import load_injector
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.export.c_code import c_sources
from observer_rt.desk.export.frozen import Frozen
from observer_rt.desk.simulation.schedule import make_schedule, parse_shots
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.model.effects import sized
from tests.desk.export.exported import MODELS, built, exported, learned, replayed, write_c

STATED_OTHERWISE = {("seat", "transition"), ("seat", "area_scale")}  # the same number as another


@pytest.mark.parametrize("name", MODELS)
def test_equals_what_runs_here(tmp_path: Path, name: str) -> None:
    write_c(tmp_path, exported(tmp_path / "injector.toml", name))
    program = built(tmp_path)
    for run in ("observer", "injector"):
        done = replayed(program, run, 1e-9)
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("rate", [20e3, 250e3])
def test_at_another_sample_rate_with_what_was_learned(tmp_path: Path, rate: float) -> None:
    it = exported(tmp_path / "injector.toml", "effects", learned(), rate)
    assert it.frozen.network.bias.any()
    assert it.frozen.network.output.any()
    write_c(tmp_path, it)
    program = built(tmp_path)
    for run in ("observer", "injector"):
        done = replayed(program, run, 1e-9)
        assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("name", ["lump", "effects"])
@pytest.mark.parametrize("shots", ["0.25@-1.2,0.2@-0.6,0.9@0,0.3@1.6", "0.16@-2,0.18@-1,0.5@0"])
def test_shots_close_together_by_a_noisy_lift(tmp_path: Path, name: str, shots: str) -> None:
    """Needles that bounce, stay low, and open before x^ is at rest; lifts with a toe, and without."""
    schedule = make_schedule([50e6, 140e6], 4, 0.04, (), parse_shots(shots))
    noise = SimulatedNoise(needle_lift=0.25e-6)
    made = simulate(
        load_injector(), schedule, 100e3, (sized("orifice_area", v_H=-0.1),), noise, seed=3
    ).recording
    it = exported(tmp_path / "injector.toml", name, recording=made)
    write_c(tmp_path, it)
    assert np.count_nonzero(np.diff(it.runs["observer"].outputs["is_open"]) > 0.0) >= 11
    done = replayed(built(tmp_path), "observer", 1e-9)
    assert done.returncode == 0, done.stdout


def test_rate_and_states_are_those_of_evaluate(tmp_path: Path) -> None:
    """By a recording of one's own, through the whole command: frames, alignment, front end."""
    it = exported(tmp_path / "injector.toml", "lump", learned())
    write_c(tmp_path, it)
    schedule = make_schedule([80e6], 2, 0.03, [0.9e-3])
    quiet = SimulatedNoise(rail_pressure=0.05e6, needle_lift=0.0, line_pressure=0.05e6)  # no outliers
    recording = simulate(
        it.bench.injector.parameters, schedule, 100e3, (sized("seat_area", v_S=-0.1),), quiet
    ).recording
    lift = np.where(
        recording.needle_lift < 2.1e-6, 0.0, recording.needle_lift
    )  # nothing that may move its zero
    recording = replace(recording, needle_lift=lift)
    trace = evaluate(it.bench, [recording], learned(), learning=False).evaluations[0].trace
    table = np.column_stack([recording.time, recording.rail_pressure, lift, recording.line_pressure])
    np.savetxt(tmp_path / "mine.csv", table, delimiter=",", header="t,r,l,p", fmt="%.17g")
    command = [str(built(tmp_path)), "observer", str(tmp_path / "mine.csv")]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    found = np.loadtxt(StringIO(printed), delimiter=",")
    rate, valid = trace.injection_rate[: len(found)], np.isfinite(trace.injection_rate[: len(found)])
    assert np.array_equal(found[:, 0] == 1.0, valid)
    assert np.nanmax(rate) > 20e-6
    np.testing.assert_allclose(found[valid, 2], rate[valid], atol=1e-9 * np.nanmax(rate))
    c = it.frozen.constants.coefficients
    x = (found[:, [4, 6]] - c.chamber_pressure) / c.pressure_scale
    np.testing.assert_allclose(x[valid], trace.x[: len(found), ::2][valid], atol=1e-9)


@pytest.mark.parametrize(
    ("macro", "runs"),
    [
        ("NOZZLE_FLOW", {"observer", "injector"}),
        ("SAC_A6", {"observer", "injector"}),
        ("SEAT_DIAMETER", {"observer", "injector"}),
        ("SENSOR_LAG", {"observer", "injector"}),
        ("CRITICAL_EXCESS", {"observer", "injector"}),
        ("LIFT_SHIFT", {"observer"}),
        ("SENSOR_OFFSET", {"observer"}),
    ],
)
def test_a_number_that_is_another_is_seen(tmp_path: Path, macro: str, runs: set[str]) -> None:
    it = exported(tmp_path / "injector.toml", "effects", learned())
    write_c(tmp_path, it)
    header = tmp_path / "parameters.h"
    changed = re.sub(rf"(#define {macro} )R\((.*)\)", r"\1(R(\2) * R(1.00001))", header.read_text())
    assert changed != header.read_text()
    header.write_text(changed)
    program = built(tmp_path)
    assert {run for run in ("observer", "injector") if replayed(program, run, 1e-9).returncode == 1} == runs


@pytest.mark.parametrize("name", ["effects", "wave, terms"])
def test_single_precision(tmp_path: Path, name: str) -> None:
    """Nowhere double precision; innovations are small differences of large pressures."""
    write_c(tmp_path, exported(tmp_path / "injector.toml", name), single=True)
    program = built(tmp_path, "-Wno-double-promotion")
    strict = [path for path in tmp_path.glob("*.c") if path.name != "replay.c"]
    flags = ("-std=c99", "-Wdouble-promotion", "-Wfloat-conversion", "-Werror", "-c")
    for path in strict:
        command = ["cc", *flags, str(path)]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    for run in ("observer", "injector"):
        done = replayed(program, run, 2e-3)
        assert done.returncode == 0, done.stdout
        column = 3 if run == "observer" else 1
        rate = re.search(rf"column {column}: (\S+)", done.stdout)
        assert rate is not None
        assert float(rate[1]) < 5e-6


def defined(path: Path) -> list[str]:
    """Names that an object file defines for others."""
    with path.open("rb") as file:
        symbols = ELFFile(file).get_section_by_name(".symtab").iter_symbols()
        return [
            str(one.name)
            for one in symbols
            if one["st_info"]["bind"] != "STB_LOCAL" and one["st_shndx"] != "SHN_UNDEF"
        ]


def test_nothing_is_allocated_or_printed(tmp_path: Path) -> None:
    sources = write_c(tmp_path, exported(tmp_path / "injector.toml", "wave, terms"))
    for name, text in sources.items():
        if name != "replay.c":
            assert not re.search(r"stdlib|stdio|alloc\(|printf", text), name
    for path in tmp_path.glob("*.c"):
        if path.name != "replay.c":
            subprocess.run(
                ["cc", "-c", str(path), "-o", str(path.with_suffix(".o"))], cwd=tmp_path, check=True
            )
    globals_ = [name for path in tmp_path.glob("*.o") for name in defined(path)]
    assert len(globals_) > 20
    assert all(name.lower().startswith("inj_") for name in globals_)


def test_what_is_not_in_memory_shows(tmp_path: Path) -> None:
    write_c(tmp_path, exported(tmp_path / "injector.toml", "wave, terms"))
    program = built(tmp_path, "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    for run in ("observer", "injector"):
        done = replayed(program, run, 1e-9)
        assert done.returncode == 0, done.stdout + done.stderr


def test_a_sample_without_line_pressure_corrects_nothing(tmp_path: Path) -> None:
    it = exported(tmp_path / "injector.toml", "lump")
    write_c(tmp_path, it)
    rows = (tmp_path / "observer_inputs.csv").read_text().splitlines()
    head, last = rows[1500].rsplit(",", 1)
    assert float(last) > 1e6
    rows[1500] = f"{head},nan"
    (tmp_path / "mine.csv").write_text("\n".join(rows) + "\n")
    command = [str(built(tmp_path)), "observer", str(tmp_path / "mine.csv")]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    found = np.loadtxt(StringIO(printed), delimiter=",")
    assert np.isfinite(found).all()
    assert found[1499, 3] == 0.0
    assert np.count_nonzero(found[400:, 3] == 0.0) == 1


def test_every_number_of_the_model_is_in_it(tmp_path: Path) -> None:
    """One more field in the core's records would be missing here."""
    for name in ("effects", "wave, two parts"):
        it = exported(tmp_path / "injector.toml", name).frozen
        before = c_sources(it, single=False)

        def differs(changed: Frozen, before: Mapping[str, str] = before) -> bool:
            return c_sources(changed, single=False) != before

        def other(values: Any, field: str) -> Any:
            return values._replace(**{field: getattr(values, field) + 1})

        assert all(differs(replace(it, line=other(it.line, field))) for field in it.line._fields)
        assert all(
            differs(replace(it, sensor=other(it.sensor, field)))
            for field in it.sensor._fields
            if field != "late"
        )
        c = it.constants.coefficients
        for part in ("seat", "nozzle", "sac"):
            for field in getattr(c, part)._fields:
                changed = c._replace(**{part: other(getattr(c, part), field)})
                is_seen = differs(replace(it, constants=it.constants._replace(coefficients=changed)))
                assert is_seen == ((part, field) not in STATED_OTHERWISE), (part, field)
        for field in ("rail_factor", "rail_shift", "lift_factor", "lift_shift"):
            inputs = other(it.constants.inputs, field)
            assert differs(replace(it, constants=it.constants._replace(inputs=inputs)))
        assert set(it.constants.inputs._fields) == {
            *("rail_factor", "rail_shift", "lift_factor", "lift_shift"),
            *("lift_lag", "rail_delay"),  # refused
        }
