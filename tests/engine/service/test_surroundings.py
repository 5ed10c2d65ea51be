"""The optional inputs `fuel_temperature` and `chamber_pressure`: the model follows them, nothing is valid without."""

import math
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import cantools
import numpy as np
import pytest

from observer_rt.config.bench import Bench, load_bench, load_injector
from observer_rt.config.signals import Role
from observer_rt.core.frames.frames import GRACE
from observer_rt.desk.check.bench_rules import checkup
from observer_rt.desk.check.findings import Level
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, Simulation, simulate
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.stream.state import Reason, State
from observer_rt.files.formats import open_recording
from observer_rt.files.replay.framing import Span, TimedFrame
from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.table_writers import recording_writer
from observer_rt.foundation.errors import UserError
from observer_rt.model.effective import coefficients
from observer_rt.model.effects import sized
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.surroundings import Surroundings, in_surroundings
from observer_rt.model.wave_line import with_cells
from tests.benches import SAMPLE_RATE, sample_bench
from tests.daemon.end_to_end import DATABASE
from tests.desk.evaluation.documents import recording_json
from tests.device import Device, core_of, encoded, hand, inserted, recoded, run, simulated

NOMINAL = load_injector()
REFERENCE, HOT = 40.0, 85.0  # degC
BLOCK = 9  # samples in a frame
FILED, OTHER = 2.0, 6.0  # MPa in the chamber
RAISED = 1115  # frame in the middle of the second injection
INJECTIONS = 4
SENSOR = """VERSION ""
BU_: Bed
BO_ 803 Sensor: 8 Bed
 SG_ Fuel : 0|16@1+ (0.1,-100) [-100|400] "degC" Bed
 SG_ Chamber : 16|16@1+ (0.01,-1) [-1|600] "bar" Bed
VAL_ 803 Fuel 65535 "SNA" ;
"""
SENSOR_MESSAGE = cantools.database.load_string(SENSOR, "dbc").get_message_by_name("Sensor")

Fuel = Callable[..., float | None]


@cache
def fuel_at(celsius: float, injections: int = INJECTIONS) -> Simulation:
    """Injections of a nozzle worn by 20 %, its fuel so warm, 50 ms each. The law written out once more."""
    warmer = celsius - REFERENCE
    changes = {
        "density_line": 830.0 * (1.0 - 7e-4 * warmer),
        "density_nozzle": 830.0 * (1.0 - 7e-4 * warmer),
        "bulk_modulus_line": 1.6e9 - 7e6 * warmer,
        "bulk_modulus_sac": 1.6e9 - 7e6 * warmer,
    }
    injector = NOMINAL.model_copy(update={"fluid": NOMINAL.fluid.model_copy(update=changes)})
    schedule = make_schedule([100e6], injections, 0.05, [1.1e-3])
    return simulate(injector, schedule, SAMPLE_RATE, (sized("orifice_area", v_H=0.2),), SimulatedNoise(), seed=3)


def true_mass(rate: np.ndarray, report: InjectionReport, celsius: float = REFERENCE) -> float:
    """Of an injection [kg], over the window the observer has for it."""
    volume = float(np.trapezoid(rate[report.start_index : report.end_index + 1])) / SAMPLE_RATE
    return volume * 830.0 * (1.0 - 7e-4 * (celsius - REFERENCE))


def bench(folder: Path, timeout: str = "") -> Path:
    (folder / "sensor.dbc").write_text(SENSOR)
    extra = '[[dbc]]\nfile = "sensor.dbc"\n[signals.fuel_temperature]\nmessage = "Sensor"\nsignal = "Fuel"\n'
    return sample_bench(folder, extra=extra + timeout)


def block_bench(folder: Path) -> Path:
    extra = '[signals.fuel_temperature]\nmessage = "SampleBlock"\nsignal = "FuelTemperature"\n'
    return sample_bench(folder, extra=extra)


def sensor(celsius: float | None) -> TimedFrame:
    """A frame of the sensor; None: not available."""
    return encoded(SENSOR_MESSAGE, b"\xff\xff" + bytes(6) if celsius is None else {"Fuel": celsius, "Chamber": 0})


@cache
def frames_at(celsius: float) -> list[TimedFrame]:
    return Device().send(fuel_at(celsius).recording)


def test_masses_of_hot_fuel_are_valid_with_its_temperature_only(tmp_path: Path) -> None:
    """Untold, fuel 45 K warmer looks like a softer, lighter one: nothing is valid then."""
    hot = fuel_at(HOT)
    frames = frames_at(HOT)
    with_temperature = run(bench(tmp_path), [sensor(HOT), *frames])
    untold = run(sample_bench(tmp_path / "untold"), frames)
    measured = hot.recording.with_arrays({"fuel_temperature": np.full(hot.recording.samples, HOT + 273.15)})
    (recorded,) = evaluate(load_bench(tmp_path / "untold/bench.toml"), [measured]).evaluations
    for number in range(2, INJECTIONS):
        for report in (with_temperature.reports[number], recorded.reports[number]):
            assert report.valid
            assert report.mass == pytest.approx(true_mass(hot.truth.injection_rate, report, HOT), rel=4e-3)
        assert not untold.reports[number].valid
    assert abs(with_temperature.reports[-1].indicators["bulk_modulus"].value) < 0.02
    assert untold.reports[-1].indicators["bulk_modulus"].value < -0.1


def test_a_block_may_carry_it_in_kelvins(tmp_path: Path) -> None:
    signal = DATABASE.get_message_by_name("SampleBlock").get_signal_by_name("FuelTemperature")
    code = int(signal.conversion.numeric_scaled_to_raw(HOT + 273.15))
    by_block = run(block_bench(tmp_path), [recoded(frame, FuelTemperature=code) for frame in frames_at(HOT)])
    (tmp_path / "other").mkdir()
    by_sensor = run(bench(tmp_path / "other"), [sensor(HOT), *frames_at(HOT)])
    assert by_block.reports[-1].surroundings.fuel_temperature == pytest.approx(HOT + 273.15, abs=0.01)
    assert by_block.reports[-1].mass == pytest.approx(by_sensor.reports[-1].mass, rel=1e-3)


def test_nothing_is_valid_before_it_is_known(tmp_path: Path) -> None:
    result = run(bench(tmp_path), frames_at(REFERENCE))
    assert [report.reason for report in result.reports] == [Reason.INPUT_STALE] * INJECTIONS
    assert result.core.state == (State.DEGRADED, Reason.INPUT_STALE)
    assert result.core.knowledge.state.events == 0


@pytest.mark.parametrize("broken", [sensor(None), sensor(-100.0), sensor(300.0)])
def test_what_is_no_temperature_of_a_fuel_counts_as_none(tmp_path: Path, broken: TimedFrame) -> None:
    """The last good value is kept meanwhile, for a second."""
    frames = frames_at(HOT)
    disturbed = run(bench(tmp_path), inserted(frames, [(0, sensor(HOT)), (400, broken)]))
    assert [report.valid for report in disturbed.reports[2:]] == [True, True]
    assert disturbed.frames == run(bench(tmp_path), [sensor(HOT), *frames]).frames
    first = run(bench(tmp_path), [broken, *frames])
    assert not any(report.valid for report in first.reports)


def test_it_takes_effect_between_events(tmp_path: Path) -> None:
    """Sent in the middle of the third injection, it holds from the fourth on."""
    frames = frames_at(REFERENCE)
    usual = run(bench(tmp_path), [sensor(REFERENCE), *frames])
    middle = (usual.reports[2].start_index + usual.reports[2].end_index) // 2 // BLOCK
    result = run(bench(tmp_path), inserted(frames, [(0, sensor(REFERENCE)), (middle, sensor(HOT))]))
    kelvins = [round(report.surroundings.fuel_temperature or 0.0, 2) for report in result.reports]
    assert kelvins == [313.15, 313.15, 313.15, 358.15]
    assert [r.mass for r in result.reports[:3]] == [r.mass for r in usual.reports[:3]]
    assert result.reports[3].density == pytest.approx(830.0 * (1.0 - 7e-4 * 45.0))


def test_fuel_that_warms_up_makes_no_wear(tmp_path: Path) -> None:
    """From 40 to 80 degC within eight injections: every mass is right, and no change of the injector is reported."""
    ramp = np.linspace(40.0, 80.0, 8)
    device = Device(bench(tmp_path))
    frames: list[TimedFrame] = []
    rates = []
    for celsius in ramp:
        simulated = fuel_at(float(celsius), injections=1)
        blocks = simulated.recording.samples // BLOCK
        frames += [sensor(float(celsius)), *device.send(simulated.recording)]
        device.index += (blocks + 1) * BLOCK  # a window each: the line rings on where the next begins at rest
        rates.append(np.append(simulated.truth.injection_rate[: blocks * BLOCK], np.zeros(BLOCK)))
    result = run(bench(tmp_path), frames)
    assert all(report.valid for report in result.reports)
    rate = np.concatenate(rates)
    for celsius, report in zip(ramp, result.reports, strict=True):
        true = true_mass(rate, report, float(celsius))
        assert report.mass == pytest.approx(true, rel=5e-3 if report.number > 1 else 1e-2)


def test_a_recording_is_taken_to_be_at_the_reference(tmp_path: Path) -> None:
    recording = fuel_at(REFERENCE).recording
    (tmp_path / "block").mkdir()
    for path in (bench(tmp_path), block_bench(tmp_path / "block")):
        history = evaluate(load_bench(path), [recording])
        assert [report.valid for report in history.evaluations[0].reports[2:]] == [True, True]
        shown = recording_json(history.evaluations[0], coefficients(NOMINAL))["injections"]
        assert [injection["fuel_temperature_degC"] for injection in shown] == pytest.approx([40.0] * INJECTIONS)


def test_an_injector_without_a_reference_is_refused(tmp_path: Path) -> None:
    path = bench(tmp_path)
    text = load_bench(path).injector.parameters_path.read_text()
    (tmp_path / "injector.toml").write_text(text.replace("reference_temperature", "# reference_temperature"))
    loaded = load_bench(path, model=tmp_path / "injector.toml")
    with pytest.raises(UserError, match=r"injector\.toml: fluid\.reference_temperature"):
        core_of(loaded)
    assert any(f.level is Level.ERROR and "reference_temperature" in f.text for f in checkup(loaded))


def made(folder: Path, timeout: float) -> Fuel:
    """The temperature that counts [degC] at a time [s], after a frame that is sent then; timeout [s]."""
    path = bench(folder, "" if math.isinf(timeout) else f"timeout_ms = {1e3 * timeout}\n")
    core, device = core_of(path), Device(path)

    def at(time: float, *optional_frames: TimedFrame) -> float | None:
        device.index = round(time * SAMPLE_RATE)
        samples = device.send(simulated(), Span(0, BLOCK))
        hand(core, [*samples, *(optional_frames or samples)])  # a frame that is repeated brings nothing but a look
        kelvin = float(core.compiled.pipeline.input_memory.memory["measured"][0, 0])
        return None if math.isnan(kelvin) else round(kelvin - 273.15, 1)

    return at


def test_a_value_counts_until_its_time_out(tmp_path: Path) -> None:
    at = made(tmp_path, 0.5)
    assert at(9.0) is None
    assert at(10.0, sensor(30.0)) == at(10.4) == 30.0
    assert at(10.6) is None
    assert at(11.0, sensor(40.0)) == at(11.4) == 40.0


def test_without_a_time_out_it_counts_for_ever(tmp_path: Path) -> None:
    at = made(tmp_path, math.inf)
    assert at(0.0, sensor(30.0)) == at(3600.0) == 30.0


@pytest.mark.parametrize("timeout", [0.5 * GRACE, 5 * GRACE, math.inf])
def test_a_sender_without_a_value_is_borne_for_a_while(tmp_path: Path, timeout: float) -> None:
    at = made(tmp_path, timeout)
    borne = min(timeout, 0.1 + GRACE)
    assert at(0.0, sensor(30.0)) == at(0.1, sensor(None)) == at(borne - 0.01) == 30.0
    assert at(borne + 0.01) is None
    assert at(borne + 1.0, sensor(None)) is None
    assert at(borne + 1.1) is None


def test_a_new_beginning_of_time_takes_nothing_from_it(tmp_path: Path) -> None:
    """The measuring device restarts 0.3 s after the value came: 0.2 s are left."""
    at = made(tmp_path, 0.5)
    assert at(100.0, sensor(30.0)) == at(100.3) == at(0.0) == at(0.19) == 30.0
    assert at(0.21) is None


def of_line(megapascals: float, model: str) -> InjectorParameters:
    injector = with_cells(NOMINAL.model_copy(update={"line": NOMINAL.line.model_copy(update={"model": model})}))
    return in_surroundings(injector, Surroundings(chamber_pressure=1e6 * megapascals))


@cache
def into(megapascals: float, model: str = "lump", injections: int = INJECTIONS) -> Simulation:
    schedule, injector = make_schedule([60e6], injections, 0.05, [1.1e-3]), of_line(megapascals, model)
    return simulate(injector, schedule, SAMPLE_RATE, (), SimulatedNoise())


def chamber_bench(folder: Path, timeout: str = "", model: str = "lump") -> Bench:
    """The pressure by a message of its own, the injector file says 2 MPa."""
    path = bench(folder, timeout)
    path.write_text(path.read_text().replace("fuel_temperature]", "chamber_pressure]").replace('"Fuel"', '"Chamber"'))
    return load_bench(path).with_parameters(of_line(FILED, model)).exact


def chamber(megapascals: float) -> TimedFrame:
    return encoded(SENSOR_MESSAGE, {"Fuel": 0, "Chamber": 10.0 * megapascals})


def with_pressure(recording: Recording, megapascals: float) -> Recording:
    return recording.with_arrays({"chamber_pressure": np.full(recording.samples, 1e6 * megapascals)})


def test_the_mass_of_an_injection_into_another_pressure_is_right_with_it_only(tmp_path: Path) -> None:
    """6 MPa where the file says 2: at 60 MPa that is 3.6 % of what the model expects."""
    recording, rate = into(OTHER).recording, into(OTHER).truth.injection_rate
    history = [with_pressure(recording, OTHER), into(FILED).recording]  # as the file says where nothing is recorded
    with_it, as_filed = evaluate(chamber_bench(tmp_path), history).evaluations
    (without,) = evaluate(chamber_bench(tmp_path), [recording]).evaluations
    pressures = [report.surroundings.chamber_pressure for report in (*with_it.reports, *as_filed.reports)]
    assert pressures == pytest.approx([1e6 * OTHER] * INJECTIONS + [1e6 * FILED] * INJECTIONS)
    assert all(report.valid for report in (*with_it.reports, *as_filed.reports))
    for report in with_it.reports:
        assert report.mass == pytest.approx(true_mass(rate, report), abs=report.mass_bound)
    true = true_mass(rate, with_it.reports[0])
    assert with_it.reports[0].predicted_mass == pytest.approx(true, rel=5e-3)
    assert without.reports[0].predicted_mass == pytest.approx(1.036 * true, rel=5e-3)
    assert abs(with_it.reports[-1].indicators["orifice_area"].value) < 0.01
    assert without.reports[-1].indicators["orifice_area"].value < -0.02


@pytest.mark.parametrize("suffix", [".csv", ".mf4", ".parquet"])
def test_every_format_of_recordings_has_it(tmp_path: Path, suffix: str) -> None:
    recorded = with_pressure(into(FILED).recording, OTHER)
    recorded = recorded.with_arrays({"fuel_temperature": recorded.rail_pressure / 2e5})  # some 300 K
    with recording_writer(tmp_path / f"r{suffix}", recorded.recorded) as write:
        write(recorded)
    read = open_recording(tmp_path / f"r{suffix}", None).collected()
    for name in Surroundings._fields:
        assert np.array_equal(read.signals[name], recorded.signals[name])


@pytest.mark.parametrize("impossible", [0.0, 60.0, np.inf])
def test_a_recording_with_an_impossible_one_is_refused(impossible: float) -> None:
    with pytest.raises(UserError, match=r"sample 0: chamber_pressure .*0\.01 to 40 MPa"):
        with_pressure(into(FILED).recording, impossible)


@pytest.mark.parametrize("model", ["lump", "wave"])
def test_the_pressure_takes_effect_between_events(tmp_path: Path, model: str) -> None:
    """From 2 to 6 MPa within the second injection, by frames as by a recording: the line goes on as it is."""
    parts = [into(pressure, model, 2) for pressure in (FILED, OTHER)]
    signals: dict[str, Any] = {role: np.concatenate([p.recording.signals[role] for p in parts]) for role in Role}
    rate = np.concatenate([part.truth.injection_rate for part in parts])
    raised = np.where(np.arange(rate.size) < RAISED * BLOCK, 1e6 * FILED, 1e6 * OTHER)
    recording = Recording(np.arange(rate.size) / SAMPLE_RATE, **signals, chamber_pressure=raised)
    of_bench = chamber_bench(tmp_path, model=model)
    frames = inserted(Device(of_bench).send(recording), [(0, chamber(FILED)), (RAISED, chamber(OTHER))])
    by_bus, (evaluated,) = run(of_bench, frames), evaluate(of_bench, [recording]).evaluations
    for reports in (by_bus.reports, evaluated.reports):
        for report, pressure in zip(reports, (FILED, FILED, OTHER, OTHER), strict=True):
            assert report.surroundings.chamber_pressure == pytest.approx(1e6 * pressure)
            assert report.valid
            assert report.rail_pressure == pytest.approx(60e6, abs=0.5e6)
            assert report.predicted_mass == pytest.approx(true_mass(rate, report), rel=1e-2)
    rows, shut = by_bus.core.rows(0, by_bus.core.processed), 10_300
    assert np.abs(rows["innovation"][shut : shut + 2000]).max() < 0.01  # p_0, of which the change is .04
    assert 100e6 * rows["rail_pressure"] + 6e6 == pytest.approx(recording.rail_pressure[: len(rows)], abs=0.1e6)
