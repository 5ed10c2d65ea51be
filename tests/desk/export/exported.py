"""Exports as tests make them: injector files with all that a model may have, C compiled strictly and replayed."""

import subprocess
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from observer_rt.config.bench import Bench, load_bench
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.export.c_code import c_sources
from observer_rt.desk.export.command import reference_files
from observer_rt.desk.export.compiler import compiler
from observer_rt.desk.export.frozen import Frozen, frozen_of, observer_run, without_its_bus
from observer_rt.desk.export.reference import (
    ReferenceRun,
    injector_reference,
    observer_reference,
    reference_recording,
)
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.engine.stream.standstill import RestingLift
from observer_rt.files.signals.recording import Recording
from tests.desk.cli.injector_files import injector
from tests.device import simulated

STRICT = ("-std=c99", "-O2", "-Wall", "-Wextra", "-pedantic", "-Werror")


def effect(effect_id: str, **values: tuple[float, str]) -> str:
    """An effect in force, its parameters with their units."""
    sizes = ", ".join(
        f'{name} = {{ value = {value}, unit = "{unit}" }}' for name, (value, unit) in values.items()
    )
    return f'\n[[effects]]\nid = "{effect_id}"\nparameters = {{ {sizes} }}\n'


def term(equation: str, law: str, c: tuple[float, str] | None = None) -> str:
    """A term in force; c: value and unit of its coefficient."""
    stated = "" if c is None else f'coefficient = {{ value = {c[0]}, unit = "{c[1]}" }}\n'
    return f'\n[[terms]]\nequation = "{equation}"\nlaw = "{law}"\n{stated}'


WORN = effect("orifice_area", v_H=(0.3, "-"))
EFFECTS = (
    effect("lift_offset", x_0=(8, "um"))
    + effect("line_pressure_sensor_lag", tau=(20, "us"))
    + effect("orifice_cavitation", n_crit_excess=(0.08, "-"))
    + effect("entrained_air", g=(0.004, "-"))
    + effect("chamber_pressure_rise", dp=(1.5, "MPa"))
    + effect("channel_skew", d=(25, "us"))
    + effect("rail_pressure_sensor_offset", o=(0.3, "MPa"))
    + effect("lift_dependent_seat_coefficient", a=(0.3, "-"), x_c=(50, "um"))
)
TERMS = (
    term("nozzle_flow", "-0.21 * (injection_number > 1)")
    + term("line_pressure", "c * sqrt(line_pressure - chamber_pressure) * closed", (0.1, "mm3/ms/MPa^0.5"))
    + term("line_flow", "c * (line_flow - lagged(line_flow, 0.2))", (0.05, "MPa*ms/mm3"))
    + term("needle_lift", "-0.2 * (needle_lift - lagged(needle_lift, 0.1))")
    + term("stiffness", "-0.02 * time + 0.01 * sin(2[kHz] * time_since_opening)")
    + term(
        "seat_flow", "-0.3 * table(needle_lift, 0, -0.1, 0.05[mm], 0, 0.2, 0.3) + 0.001 * min(seat_flow, 9)"
    )
    + term("inertance", "0.05 * abs(tanh(line_pressure_rate / 10)) * opening")
    + term("rail_pressure", "0.1[MPa] * max(closing, 0.2)")
    + term("chamber_pressure", "0.5[MPa] * open * exp(-time_since_opening / 1[ms])")
)
RINGING = term("line_pressure_sensor", "c * ringing(line_pressure, 7.5, 0.15)", (0.5, "-"))
HELD_OPEN = term("needle_lift", "0.002 * closed")
EARLY = effect("channel_skew", d=(-25, "us"))
MEMORY = "wall_viscosity = 3e-6\ninlet_loss_factor = 2.0\n"
MODELS: Mapping[str, tuple[str, str, str, str]] = {  # line, outflow, keys of [line], end of the file
    "lump": ("lump", "nozzle", "", WORN),
    "effects": ("lump", "seat", "", EFFECTS),
    "terms": ("lump", "nozzle", "", TERMS),
    "ringing": ("lump", "nozzle", "", RINGING),
    "held open": ("lump", "nozzle", "", HELD_OPEN),
    "wave": ("wave", "nozzle", "", EFFECTS),
    "wave, two parts": ("wave_two_part", "seat", MEMORY, WORN + EARLY),
    "wave, terms": ("wave", "nozzle", "", TERMS),
}


@dataclass(frozen=True)
class Exported:
    """A bench, its frozen observer and the reference runs."""

    bench: Bench
    frozen: Frozen
    runs: Mapping[str, ReferenceRun]


def exported(
    path: Path,
    name: str,
    knowledge: Knowledge | None = None,
    rate: float | None = None,
    recording: Recording | None = None,
) -> Exported:
    """Of a model of MODELS, whose file is written at a path; recording: instead of that of an export."""
    line, outflow, added, end = MODELS[name]
    injector(path, line, outflow, added, end)
    bench = without_its_bus(load_bench(model=path), rate)
    run = observer_run(bench, knowledge)
    frozen = frozen_of(bench, run)
    made = recording or reference_recording(bench)
    runs = {"observer": observer_reference(made, run), "injector": injector_reference(made, frozen)}
    return Exported(bench, frozen, runs)


@cache
def learned() -> Knowledge:
    """What the observer has learned of a worn nozzle, on the nominal model."""
    known = evaluate(load_bench(), [simulated(4, 0.25, (60e6, 120e6))]).knowledge
    return replace(known, lift=RestingLift())  # of a lift without noise


def write_c(folder: Path, it: Exported, single: bool = False) -> Mapping[str, str]:
    """Sources and reference runs in a folder; the sources by name."""
    folder.mkdir(exist_ok=True)
    sources = c_sources(it.frozen, single)
    for name, text in sources.items():
        (folder / name).write_text(text)
    for name, text in reference_files(it.runs).items():
        (folder / name).write_text(text)
    return sources


def built(folder: Path, *flags: str) -> Path:
    """The program that replays, from the sources of a folder; not a warning is allowed."""
    found = compiler()
    assert found is not None, "there is no C compiler: tools/test sets one up"
    program = folder / "replay"
    sources = [str(path) for path in sorted(folder.glob("*.c"))]
    done = subprocess.run(
        [found, *STRICT, *flags, "-o", str(program), *sources, "-lm"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return program


def replayed(program: Path, name: str, tolerance: float) -> "subprocess.CompletedProcess[str]":
    """The reference run of that name, which lies beside the program."""
    files = [str(program.parent / f"{name}_{kind}.csv") for kind in ("inputs", "outputs")]
    command = [str(program), name, *files, repr(tolerance)]
    return subprocess.run(command, capture_output=True, text=True, check=False)
