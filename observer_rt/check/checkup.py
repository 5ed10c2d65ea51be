"""Everything that can be said of a bench before it runs, without touching the bus."""

import math
from pathlib import Path

from observer_rt.bus.database.lookup import database_hash
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.check.bus import bus_findings
from observer_rt.check.findings import Finding, Level, as_json_document, as_table, failed, graded
from observer_rt.check.host import real_time_findings, this_host
from observer_rt.check.interface import interface_findings, read_controller
from observer_rt.check.model import plausibility_findings
from observer_rt.check.optional_inputs import fuel_findings
from observer_rt.check.time import time_findings
from observer_rt.config.bench import Bench
from observer_rt.estimation.gain import gain_schedule
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MICROSECOND, MILLISECOND
from observer_rt.model.effects import effective_model
from observer_rt.model.parameters import EffectValue
from observer_rt.model.stability import MAX_SUBSTEPS, fastest_rate
from observer_rt.observer.learning.knowledge import no_knowledge
from observer_rt.observer.observer import Durations, constants_for
from observer_rt.observer.paper_scheme.gain import doubts_about_gain
from observer_rt.observer.stream.front_end import dead_band
from observer_rt.observer.stream.state import MAX_EVENT
from observer_rt.service.core.constants import bench_constants, configured_noise
from observer_rt.service.core.learners import make_learner, refuse_state
from observer_rt.service.state_file import StateDoesNotFitError, load_knowledge, model_hash

__all__ = ["Finding", "Level", "as_json_document", "as_table", "checkup"]

SAMPLES_PER_PERIOD = 10  # of the line's own oscillation, below which it is not seen well
LARGEST_DEAD_BAND = 0.1  # of the full lift


def checkup(bench: Bench, state: Path | None = None) -> list[Finding]:
    """Findings about files, bus, observer and machine. What a file's error keeps from being looked at is left out.

    state: file with a learned state, which stays as it is.
    """
    findings = _files(bench)
    if state is not None:
        findings.append(_state(bench, state))
    findings += plausibility_findings(bench.injector)
    try:
        bus = map_bus(bench)
        findings += bus_findings(bench, bus)
        findings += time_findings(bus)
    except UserError as error:
        findings.append(failed("mapping", error))
    findings += _integration(bench)
    findings += _observer(bench)
    findings += real_time_findings(this_host())
    for link in bench.config.buses:
        if link.config.interface == "socketcan":
            controller = read_controller(link.config.channel)
            findings += interface_findings(link.config, controller, place=link.place)
    return findings


def _files(bench: Bench) -> list[Finding]:
    findings = [
        Finding("files", Level.OK, f"bench {bench.path}"),
        Finding("files", Level.OK, f"injector {bench.injector_path}, SHA-256 {model_hash(bench.injector)}"),
        *_effects(bench),
    ]
    names = ", ".join(str(path) for path in bench.databases)
    try:
        findings.append(
            Finding("files", Level.OK, f"bus database {names}, hash {database_hash(bench.databases):08X}")
        )
    except UserError as error:
        findings.append(failed("files", error))
    return findings


def _state(bench: Bench, path: Path) -> Finding:
    """What `run` would make of a learned state."""
    topic = "learned state"
    try:
        refuse_state(bench, "--state")
        scale = bench.injector.scaling.pressure
        knowledge = load_knowledge(path, model_hash(bench.injector), scale, set_aside=False).knowledge
    except StateDoesNotFitError as error:
        remedy = (
            "`run` would set it aside and begin anew: name the model file it belongs to, or another state"
        )
        return graded(topic, False, f"{error.place} {error.problem}", remedy)
    except UserError as error:
        return failed(topic, error)
    if knowledge is None:
        return Finding(topic, Level.OK, f"none at {path} yet, `run` begins with the prior")
    learned = f"{path}: phi version {knowledge.phi_version}, learned from {knowledge.events} events"
    return graded(topic, knowledge.events > 0, learned, "`run` will trust its results no sooner for it")


def _effects(bench: Bench) -> list[Finding]:
    """The effects that the injector file adds to the nominal model."""
    return [
        Finding("effects", Level.OK, " ".join([effect.id, *map(_size, effect.parameters.items())]))
        for effect in bench.injector.effects
    ]


def _size(parameter: tuple[str, EffectValue]) -> str:
    name, size = parameter
    return f"{name} = {size.value:g}" + ("" if size.unit == "-" else f" {size.unit}")


def _integration(bench: Bench) -> list[Finding]:
    try:
        substeps = bench_constants(bench).substeps
    except UserError as error:
        return [failed("integration", error)]
    model = effective_model(bench.injector)
    return [
        Finding(
            "integration",
            Level.OK,
            f"{substeps} steps a sample (at most {MAX_SUBSTEPS}) at {bench.config.sampling.rate_hz:g} Hz, "
            f"for a fastest rate of {fastest_rate(model.injector, model.departures):.3g} 1/s",
        ),
        *fuel_findings(bench),
    ]


def _observer(bench: Bench) -> list[Finding]:
    rate = bench.config.sampling.rate_hz
    noise = configured_noise(bench)
    constants = constants_for(bench.injector, rate, Durations(), events_required=0)
    sensor, lookahead = constants.sensor, constants.timing.lookahead
    schedule = gain_schedule(constants.coefficients, noise, rate, sensor.lag, sensor.fraction)
    c = constants.coefficients
    line_mode = c.line.mode / (2 * math.pi)
    opens, shuts = dead_band(noise.needle_lift)
    return [
        graded(
            "line mode",
            rate >= SAMPLES_PER_PERIOD * line_mode,
            f"{line_mode:.0f} Hz, {rate / line_mode:.3g} samples a period",
            f"sample at {SAMPLES_PER_PERIOD * line_mode:.0f} Hz or more, for {SAMPLES_PER_PERIOD} a period",
        ),
        Finding(
            "gain",
            Level.OK,
            f"steady gain {schedule.gains[-1, 0]:.3g} on p_L and {schedule.gains[-1, 1]:.3g} on Q_L (normalised); "
            f"innovation sigma {schedule.innovation_sigma * c.pressure_scale / MEGAPASCAL:.3g} MPa",
        ),
        graded(
            "dead band",
            opens <= LARGEST_DEAD_BAND * bench.injector.seat.max_lift,
            f"opens above {opens / MICROMETRE:.3g} um of lift, shuts below {shuts / MICROMETRE:.3g} um",
            f"above {LARGEST_DEAD_BAND:.0%} of the full lift short injections are missed: "
            "lower the noise of the needle lift",
        ),
        Finding("look-ahead", Level.OK, f"{lookahead} samples, {lookahead / rate / MICROSECOND:.4g} us"),
        _event_timing(bench),
        *_paper_training(bench),
    ]


def _event_timing(bench: Bench) -> Finding:
    learning = bench.config.learning
    longest = MAX_EVENT / bench.config.sampling.rate_hz / MILLISECOND
    return graded(
        "events",
        longest >= 2 * learning.event_gap_ms,
        f"openings within {learning.event_gap_ms:g} ms are one event; a new phi takes force "
        f"{learning.event_gap_ms + learning.learning_delay_ms:g} ms after the needle shuts; learned from events "
        f"up to {longest:.0f} ms, gap included",
        "shorten learning.event_gap_ms or sample slower",
    )


def _paper_training(bench: Bench) -> list[Finding]:
    """What is to be said of `training = "paper"`, nothing where it is not used."""
    gain = bench.config.learning.identification_gain
    if gain is None:
        return []
    c = effective_model(bench.injector).coefficients
    try:
        make_learner(bench, bench_constants(bench), no_knowledge(configured_noise(bench), c.pressure_scale))
    except UserError as error:
        return [failed("training", error)]
    doubts = doubts_about_gain(gain, c, configured_noise(bench))
    return [
        Finding("training", Level.WARNING, "paper: for comparison only, its results never count as valid"),
        graded("identification gain", doubts is None, f"{gain:g} 1/s", doubts or ""),
    ]
