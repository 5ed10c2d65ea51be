"""All findings about a bench before it runs, without touching anything; what `run` refuses to begin with, too."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

from observer_rt.bus.database.lookup import database_hash
from observer_rt.bus.mapping.bus_map import map_bench
from observer_rt.config.bench import Bench, BenchInjector
from observer_rt.daemon.keeper import kept_files
from observer_rt.daemon.state_file import StateDoesNotFitError, load_knowledge, model_hash
from observer_rt.desk.check.buses import buses_findings
from observer_rt.desk.check.findings import Finding, Statement, failed, graded, ruled, warning
from observer_rt.desk.check.injector import mapping_findings, time_findings
from observer_rt.desk.check.machine import machine_findings
from observer_rt.desk.check.observer import mass_findings, observer_findings
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_hash
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.plausibility import implausible as beyond_physics


def checkup(bench: Bench, state: Path | None = None) -> list[Finding]:
    """Findings about files, buses, observers and machine, without checks that an error in a file prevents.

    state: instead of the bench file's. Raises `UserError` for one state of several injectors.
    """
    findings = bench_findings(bench, state)
    is_sound = not any(finding.error for finding in findings)
    masses = for_each_injector(bench, lambda alone: mass_findings(alone.injector)) if is_sound else []
    return findings + masses + machine_findings(bench)


def refuse_errors(bench: Bench, state: Path | None, journal: Path | None, injector: str | None) -> None:
    """Raise `UserError` for the first of all errors that `checkup` finds in a bench; others as `bench_findings`."""
    findings = bench_findings(bench, state, journal, injector)
    errors = [finding.error for finding in findings if finding.error is not None]
    if not errors:
        return
    first, *others = errors
    more = f"; `observer-rt check` names {len(others)} more" if others else ""
    raise UserError(first.location, first.problem, first.remedy + more)


def bench_findings(
    bench: Bench, state: Path | None = None, journal: Path | None = None, injector: str | None = None
) -> list[Finding]:
    """All findings about a bench without its machine; state, journal: replace the files of its (only) injector."""
    chosen = None if state is None and journal is None else bench.of(injector).injector
    findings = _files(bench)

    def injector_findings(alone: Bench) -> list[Finding]:
        bench_injector = alone.injector
        files = (state, journal) if bench_injector is chosen else (None, None)
        findings = _injector_file(bench_injector) + _effects(bench_injector) + _learned_state(bench_injector, *files)
        return findings + plausibility_findings(bench_injector.parameters)

    findings += for_each_injector(bench, injector_findings)
    try:
        mapped = map_bench(bench)
        maps = {one.name: bus for one, bus in zip(bench.injectors, mapped.injectors, strict=True)}
        findings += for_each_injector(
            bench, lambda alone: mapping_findings(alone.injector, maps[alone.injector.name], mapped.database_messages)
        )
        findings += buses_findings(bench, mapped)
        findings += for_each_injector(bench, lambda alone: time_findings(maps[alone.injector.name]))
    except UserError as error:
        findings.append(failed("mapping", error))
    findings += for_each_injector(bench, lambda alone: observer_findings(alone.injector))
    return findings


def for_each_injector(bench: Bench, findings_of: Callable[[Bench], list[Finding]]) -> list[Finding]:
    """Findings about every injector, with its name where there are several."""
    return [
        replace(finding, text=f"{alone.injector.name}: {finding.text}") if alone.injector.name else finding
        for alone in bench.per_injector
        for finding in findings_of(alone)
    ]


@ruled("files")
def _files(bench: Bench) -> Iterator[Statement]:
    yield f"bench {bench.path}"
    names = ", ".join(str(path) for path in bench.databases)
    yield f"bus database {names}, hash {database_hash(bench.databases):08X}"


@ruled("files")
def _injector_file(injector: BenchInjector) -> Iterator[Statement]:
    yield f"injector {injector.parameters_path}, SHA-256 {file_hash(injector.parameters_path)}"
    values = model_hash(injector.parameters)
    yield f"its values, however they are written, SHA-256 {values}; ModelHash on the bus is {values[:8].upper()}"


@ruled("learned state")
def _learned_state(injector: BenchInjector, state: Path | None, journal: Path | None) -> Iterator[Statement]:
    """Findings about the learned state and the journal, as `run` would take them."""
    path = kept_files(injector, state, journal).state
    if path is None:
        return
    try:
        knowledge = load_knowledge(path, injector.parameters, set_aside=False).knowledge
    except StateDoesNotFitError as error:
        remedy = "`run` would set it aside and begin anew: name the model file it belongs to, or another state"
        yield warning(f"{error.location} {error.problem}", remedy)
        return
    if knowledge is None:
        yield f"none at {path} yet, `run` begins with the prior"
        return
    learned = f"{path}: correction {knowledge.phi_version}, learned from {knowledge.state.events} events"
    yield graded(knowledge.state.events > 0, learned, "`run` will trust its results no sooner for it")


@ruled("effects")
def _effects(injector: BenchInjector) -> Iterator[Statement]:
    yield from injector.parameters.in_force


@ruled("injector")
def plausibility_findings(injector: InjectorParameters) -> Iterator[Statement]:
    """A warning for every parameter that no injector has, or one finding that all can be."""
    odd = beyond_physics(injector)
    for number in odd:
        entries = number.made_up_for if injector.baseline is not None else ""
        yield warning(number.words, f"check {entries}" if entries else "is it in SI units?")
    if not odd:
        yield "every parameter is one an injector can have"
