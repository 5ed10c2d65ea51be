"""`tools/golden`: events as they reached a learner, what came of them then, and what becomes of them today."""

import json
import time
from collections.abc import Callable
from dataclasses import replace
from itertools import islice, product
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer

from observer_rt.config.bench import NOMINAL_INJECTOR, exact_text
from observer_rt.config.injector_sections import Meaning
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.engine.stream.state import Constants
from observer_rt.foundation.errors import RunError
from tests.engine.learning import golden_events as golden
from tests.engine.learning import learner_adapter as adapter
from tests.engine.learning.learner_adapter import Chain, Named
from tests.observed_plants import bench_at, commanded, recording_of
from tests.plants.arrays import Array
from tests.plants.histories import FIRST, POINTS, PRODUCTS, WEAR, Kind, bench_of, close_shots
from tests.plants.laws import NINE_LAWS, Laws
from tests.plants.parameters import Faults
from tests.plants.plant import Bench, record
from tools.benchmarks import needles
from tools.benchmarks.discovery.discrepancies import Discrepancy
from tools.benchmarks.faults.fault import PlacedFault
from tools.benchmarks.faults.table import TABLE
from tools.benchmarks.worn_lines import on_line, worn_model

SEED, MM3_PER_MS = 1, 1e-6
LINES = (Discrepancy.PLAIN, Discrepancy.END_VOLUMES)
app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


class Recipe(NamedTuple):
    """A chain to be made; line: that the injector was fitted on; needle: that only commands tell of."""

    bench: Bench
    line: Discrepancy | None = None
    needle: needles.Kind | None = None
    is_commanded: bool = False

    @property
    def kind(self) -> str:
        return "waves" if self.line else "no lift" if self.needle else "lump"


def _worn(name: str, kind: Kind, events: int = 8) -> Bench:
    return bench_of(kind, [POINTS[k % len(POINTS)] for k in range(events)], SEED, name)


def _disturbed(bench: Bench, fault: str, size: float, since: float = 0.0) -> Bench:
    return PlacedFault(TABLE[fault], size, since, 1e3, SEED).on(bench)


def recipes() -> dict[str, Recipe]:
    coking, usual, bounces = Laws(coking=0.3), needles.Kind.USUAL, needles.Kind.BOUNCES
    lump = {"nozzle and seat worn": Kind(WEAR[1]), "healthy": Kind(), "nozzle worn": Kind(WEAR[0])}
    lump |= {f"nozzle {100 * v:+.0f} % at once": Kind(Faults(orifice_area=v), before=5) for v in (0.03, 0.13, -0.3)}
    lump |= {"seat -25 % at once": Kind(Faults(seat_area=-0.25), before=5), "lift late": Kind(late=4e-5, before=4)}
    lump |= {name: Kind(faults, law) for name, (law, faults) in islice(NINE_LAWS.items(), 0, None, 3)}
    lump |= {name: Kind(laws=law) for name, law in islice(PRODUCTS.items(), 1, None, 4)}
    made = {f"lump: {name}": Recipe(_worn(name, kind)) for name, kind in lump.items()}
    for number, (name, point) in enumerate(islice(product(FIRST, POINTS), 0, None, 7)):
        made[f"first: {name}"] = Recipe(bench_of(FIRST[name], [point] * (1 + number % 2), SEED, name, *point))
    waves = {("worn", LINES[0]): Kind(WEAR[0]), ("jump", LINES[1]): Kind(Faults(orifice_area=0.13), before=4)}
    waves |= {("worn", LINES[1]): Kind(WEAR[1]), **{("coking", line): Kind(laws=coking) for line in LINES}}
    for (name, line), kind in waves.items():
        made[f"waves: {name}, {line}"] = Recipe(on_line(_worn(f"{line} {name}", kind), line, SEED), line)
    made["waves: no lift"] = Recipe(on_line(_worn("waves", Kind(WEAR[0]), 5), LINES[0], SEED), LINES[0], usual)
    for needle, kind in product((usual, bounces, needles.Kind.JITTERS), (Kind(WEAR[0]), Kind(WEAR[0], coking))):
        name = f"no lift: {needle}{' coking' * (kind.laws == coking)}"
        made[name] = Recipe(_worn(name, kind, 6), needle=needle)
    made["no lift: line late"] = Recipe(_worn("late line", Kind(Faults(channel_skew=2e-5)), 6), needle=usual)
    drift, shots = _worn("drift", Kind()), close_shots(SEED)[2].bench
    events = tuple(replace(e, faults=Faults(orifice_area=0.02 * k)) for k, e in enumerate(drift.events))
    made["lump: wear that moves on"] = Recipe(replace(drift, events=events))
    made["lump: three shots"] = Recipe(replace(shots, events=shots.events[:5]))
    for flow, coil in ((4.0, 0.0), (8.0, 0.0), (4.0, 0.3)):
        pilot = _worn(f"pilot {flow}", Kind(WEAR[0], Laws(control_flow=flow * MM3_PER_MS)))
        made[f"pilot: {flow:g} mm3/ms, coil {coil:g} MPa"] = Recipe(_disturbed(pilot, "energizing_on_line", coil))
    made["pilot: by commands"] = Recipe(pilot, is_commanded=True)
    for rate, means in product((50e3, 20e3), (False, True)):
        bench = replace(_worn(f"{rate}", Kind(WEAR[0]), 5), sample_rate=rate, averaged=means)
        made[f"lump: {rate / 1e3:g} kHz{' means' * means}"] = Recipe(bench)
    faults = (
        ("offset_drift_line", 1.0, 0.0), ("late_line", 20.0, 0.0), ("late_lift", 20.0, 0.0), ("noise", 3.0, 0.0),
        ("coloured_3_khz_line", 0.4, 0.0), ("coloured_300_hz_rail", 0.2, 0.0), ("hum_150_hz_line", 0.3, 0.0),
        ("spikes_line", 10.0, 0.0), ("spikes_rail", 10.0, 0.0), ("jitter", 2.0, 0.0), ("unit_rail", 0.1, 0.3),
        ("frozen_rail", 0.0, 0.25), ("frozen_line", 0.0, 0.33), ("step_line", 1.5, 0.3), ("lag_line", 100.0, 0.25),
        ("gain_step_line", 0.9, 0.3), ("swapped_pressures", 0.0, 0.3), ("dropouts_to_full_scale", 5.0, 0.0),
        ("lift_crosstalk", 1.5, 0.0), ("line_clipped_at_the_top", 4.0, 0.0), ("only_noise_line", 5.0, 0.3),
        ("frozen_samples_line", 0.5, 0.0),
    )  # fmt: skip
    disturbed = {name: _disturbed(_worn(name, Kind(WEAR[0]), 5), name, *others) for name, *others in faults}
    return made | {f"fault: {name}": Recipe(bench) for name, bench in disturbed.items()}


def _made(name: str, recipe: Recipe) -> tuple[Chain, list[Named]]:
    """A chain by its recipe, and what of it reaches the learner."""
    bench, model = recipe.bench, adapter.GOLDEN / (f"{recipe.line}.toml" if recipe.line else "nominal.toml")
    if not model.exists():
        fitted = recipe.line and worn_model(recipe.line, SEED, Path("build/golden"))
        model.write_text(fitted.read_text() if fitted else exact_text(NOMINAL_INJECTOR))
    observer, outcome = bench_at(bench.sample_rate, model), record(bench)
    law, recording = observer.injector.parameters.needle_law, recording_of(outcome)
    if recipe.is_commanded:
        recording = commanded(bench, outcome, law.opening_delay, law.closing_delay)
    if recipe.needle is not None:
        recording = needles.recorded(bench, law, recipe.needle).recording
    recording = replace(recording, meaning=Meaning.MEAN if bench.averaged else Meaning.INSTANT)
    events, constants = list[Named](), list[Constants]()
    evaluate(observer, [recording], learner_of=adapter.recorder(events, constants))
    traits = bench.averaged, recipe.needle is None, recording.energizing is not None
    chain = Chain(name, recipe.kind, model.name, bench.sample_rate, len(events), *traits)
    rebuilt = dict(adapter.flat("", chain.constants[1]))
    if any(golden.differences(rebuilt, dict(adapter.flat("", each))) for each in constants):
        raise RunError(f"{name}: its constants are not those of its bench")
    return chain, events


def _hostile(usual: list[Named]) -> list[Named]:
    """Usual events, and between them those whose numbers no injector has."""
    sampled = dict.fromkeys(("rail", "areas", "output", "resting", "masked", "bends"), lambda v: v[..., :1])
    noise, swing = np.random.default_rng(1).normal(size=9999), 0.1 * np.sin(np.arange(9999) / 7.0)
    lines = (
        lambda v: 1e200 * v, lambda v: v + 5.0, np.negative, lambda v: 3.0 * v, np.zeros_like,
        lambda v: v + swing[: v.size], lambda v: v + noise[: v.size],
    )  # fmt: skip
    changes: list[dict[str, Callable[[Array], Array]]] = [
        *({"output": line} for line in lines), {"rail": np.negative}, {"rail": lambda v: v + 10.0 * swing[: v.size]},
        {"areas": np.zeros_like}, {"areas": lambda v: 1e6 * v}, {"start": lambda v: 1e9 * v},
        {"masked": np.ones_like}, {"opening": np.ones_like}, {**sampled, "opening": np.zeros_like},
        {"in force": lambda v: v + 1e3}, {"standstill": lambda v: v + np.eye(10)[1]},
        {"standstill": lambda v: v * [1, 1, 50, 50, 10, 1, 1, 1, 1, 1]},
    ]  # fmt: skip
    made = []
    for number, change in enumerate(changes):
        event = usual[number % len(usual)]
        changed = {name: np.array(new(np.array(event[name]))) for name, new in change.items()}
        made += [*[event] * (number % 3 == 2), {**event, **changed}]
    return [*made, usual[0]]


@app.command("record", epilog="Example: tools/golden record")
def record_outcomes(
    with_inputs: Annotated[bool, typer.Option("--inputs", help="Make the events anew, too: minutes.")] = False,
) -> None:
    """Keep the outcomes of today, which changed on purpose."""
    if with_inputs:
        made = []
        for name, recipe in recipes().items():
            print(f"{name} ...", flush=True)
            made.append(_made(name, recipe))
        hostile = _hostile(next(events for chain, events in made if chain.name == "lump: nozzle worn"))
        made.insert(0, (made[0][0]._replace(name="hostile", kind="hostile", events=len(hostile)), hostile))
        lines = ",\n".join(json.dumps(chain._asdict()) for chain, _ in made)
        golden.CHAINS.write_text(f"[\n{lines}\n]\n")
        golden.write(golden.INPUTS, [event for _, events in made for event in events], {})
    new = [outcome for chain, _ in golden.recorded(golden.INPUTS) for outcome in golden.outcomes(chain)]
    golden.write(golden.OUTCOMES, new, golden.machine())


@app.command(epilog="Examples: tools/golden compare; tools/golden compare 'no lift' --most 10")
def compare(
    part: Annotated[str, typer.Argument(help="Part of names of chains (default: all).")] = "",
    most: Annotated[int, typer.Option(help="Differences shown of an event, the largest first.")] = 3,
) -> None:
    """Say which outcomes of recorded events are others today, by how much, and what an event costs."""
    before, today = golden.read(golden.OUTCOMES)[1], golden.machine()
    if other := [name for name, value in today.items() if before[name] != value]:
        print(f"recorded with other {', '.join(other)}: last digits differ")
    summary, seconds = list[str](), dict[str, list[float]]()
    for chain, expected in [each for each in golden.recorded(golden.OUTCOMES) if part in each[0].name]:
        apart, learned = list[list[golden.Difference]](), golden.outcomes(chain)
        for number, outcome in enumerate(expected):
            begin = time.process_time()
            now = next(learned)
            seconds.setdefault(chain.kind, []).append(time.process_time() - begin)
            apart.append(golden.differences(outcome, now))
            for off in apart[-1][:most]:
                sizes = f"{off.relative:.1e}, {off.sigmas:.1e} sigma"
                print(f"{chain.name}, {number}: {off.name} {sizes}: {off.text}")
        relative, sigmas = (max((d[i] for each in apart for d in each), default=0.0) for i in (0, 1))
        changed = f"{sum(map(bool, apart)):3d} of {chain.events:3d} events differ"
        summary.append(f"{chain.name:50s} {changed}, by {relative:.1e} and {sigmas:.1e} sigma at most")
    print("\n".join(summary))
    for kind, spent in seconds.items():
        print(f"{kind}: {1e3 * np.median(spent):.1f} ms of processor an event (median of {len(spent)})")


if __name__ == "__main__":
    app()
