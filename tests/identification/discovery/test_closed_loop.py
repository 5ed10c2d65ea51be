"""From recordings that disagree with the model to a daemon that is right: discover, restart, listen on the bus."""

import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.config.bench import load_injector
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.files.formats import write_recording
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effective import coefficients
from observer_rt.model.effects import sized
from tests.daemon.end_to_end import SUMMARY, Heard, command, decoded, write_bench
from tests.daemon.participants import over_bus
from tests.device import frames_of

RATE_HZ = 100e3
RAIL_PRESSURES, ENERGIZING_TIMES = (60e6, 100e6, 140e6), (0.6e-3, 1.9e-3)
MILLIGRAM = 1e-6
LIFT_OFFSET = (sized("lift_offset", x_0=20e-6),)
WORN = (sized("orifice_area", v_H=0.12), sized("line_friction", k=0.6))


@dataclass(frozen=True)
class Published:
    """What the bus said of a run of injections: per injection, against the truth."""

    mass_error: NDArray[np.float64]  # relative, (n,)
    valid: list[bool]
    nozzle_wear: list[float]  # v_H on top of the model in force


def amended_model(folder: Path, effects: tuple[SizedEffect, ...]) -> Path:
    """What `observer-rt discover` makes of six recordings with hidden effects."""
    files: list[Path] = []
    for number, pressure in enumerate(RAIL_PRESSURES):
        for duration in ENERGIZING_TIMES:
            schedule = make_schedule([pressure], 2, 0.06, [duration])
            made = simulate(load_injector(), schedule, RATE_HZ, effects, SimulatedNoise(), seed=len(files))
            files.append(folder / f"{number}_{duration * 1e6:.0f}.csv")
            write_recording(files[-1], made.recording)
    done = subprocess.run(
        command("discover", "--out", folder / "found", *files), capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return folder / "found" / "amended.toml"


def on_the_bus(folder: Path, model: Path | None, effects: tuple[SizedEffect, ...]) -> Published:
    """Six injections of the injector with hidden effects, through a daemon started anew with `model`."""
    schedule = make_schedule(RAIL_PRESSURES, 6, 0.06, [1.2e-3])
    made = simulate(load_injector(), schedule, RATE_HZ, effects, SimulatedNoise(), seed=77)
    bench = write_bench(folder, "virtual", folder.name, RATE_HZ)
    if model is not None:
        text = bench.read_text()
        assert "[model]\n" in text
        bench.write_text(text.replace("[model]\n", f'[model]\nfile = "{model}"\n'))
    frames = frames_of(bench, made.recording)
    heard, _ = over_bus(bench, frames)
    return published(heard, made.truth.injection_rate)


def published(heard: Heard, true_rate: NDArray[np.float64]) -> Published:
    density = coefficients(load_injector()).density
    summaries = [decoded(SUMMARY, payload) for payload in heard.summaries]
    assert len(summaries) == 6
    errors = []
    for summary in summaries:
        window = slice(int(summary["SampleIndex"]), int(summary["EndIndex"]) + 1)
        true = float(np.trapezoid(true_rate[window])) / RATE_HZ * density / MILLIGRAM
        errors.append(summary["Mass"] / true - 1.0)
    return Published(
        np.array(errors), [bool(s["Valid"]) for s in summaries], [s["NozzleWear"] for s in summaries]
    )


@pytest.mark.slow
def test_lift_offset_found_and_the_rate_is_right_and_valid(tmp_path: Path) -> None:
    """20 um: without the amended model nothing is valid and masses are percents off."""
    before = on_the_bus(tmp_path, None, LIFT_OFFSET)
    assert not any(before.valid)
    assert np.abs(before.mass_error).max() > 0.02
    after = on_the_bus(tmp_path, amended_model(tmp_path, LIFT_OFFSET), LIFT_OFFSET)
    assert after.valid == [False, False, True, True, True, True]  # two events are judged before
    assert np.abs(after.mass_error[2:]).max() < 0.01


@pytest.mark.slow
def test_wear_and_friction_found_and_the_first_injection_is_right(tmp_path: Path) -> None:
    before = on_the_bus(tmp_path, None, WORN)
    assert abs(before.mass_error[0]) > 0.05
    after = on_the_bus(tmp_path, amended_model(tmp_path, WORN), WORN)
    assert abs(after.mass_error[0]) < 0.005
    assert after.valid == [False, False, True, True, True, True]
    assert np.abs(after.mass_error[2:]).max() < 0.01
    assert np.abs(after.nozzle_wear[2:]).max() < 0.02  # nothing is left to learn
