"""The observer on recordings of a plant, which shares no code with it; each case runs once."""

from collections.abc import Callable, Sequence
from functools import cache

from observer_rt.config.bench import load_injector
from observer_rt.engine.estimation.parameters import SCALARS, Element
from observer_rt.engine.reports.indicators import Estimate
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effective import coefficients
from observer_rt.model.parameters import EffectInForce, EffectValue, InjectorParameters
from tests.observed_plants import ObservedRun, bench_at, observed
from tests.plants.laws import NO_LAWS, Laws
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench, Event, Needle, Shot, Step, Surroundings

EVENTS = 10
HEALTHY = Faults()
GATED = {
    row.shown.effect
    for row in SCALARS.rows
    if row.shown is not None and row.gated_from is not None and row.element is not Element.NEEDLE
}
"""Effects with a gate, of a bench with a lift."""
RAIL_PRESSURES = (60e6, 100e6, 140e6, 80e6, 120e6)  # Pa
TURN = RAIL_PRESSURES[:3]
DURATIONS = (1.4e-3, 0.9e-3, 1.9e-3)  # s, of the openings


def indicator(run: ObservedRun, effect: str) -> Estimate:
    estimate = run.reports[-1].indicators[effect]
    si = next(shown.si(coefficients(load_injector())) for _, shown in SCALARS.shown() if shown.effect == effect)
    return Estimate(estimate.value * si, None if estimate.sigma is None else estimate.sigma * si)


def in_force(effect: SizedEffect) -> EffectInForce:
    sizes = zip(effect.effect.parameters, effect.values, strict=True)
    printed = {p.name: EffectValue(value=value / p.si, unit=p.unit) for p, value in sizes}
    return EffectInForce(id=effect.effect.id, parameters=printed)


def with_effects(injector: InjectorParameters, *effects: SizedEffect) -> InjectorParameters:
    return injector.model_copy(update={"effects": tuple(map(in_force, effects))})


def in_turn(
    count: int,
    faults_at: Callable[[int], Faults],
    rail_pressures: Sequence[float] = RAIL_PRESSURES,
    durations: Sequence[float] = DURATIONS,
) -> tuple[Event, ...]:
    """Single injections at operating points in turn, each at another moment between two samples."""
    points = [(rail_pressures[k % len(rail_pressures)], durations[k % len(durations)]) for k in range(count)]
    return tuple(
        Event(rail, (Shot(7e-6 * (k % 5), duration),), faults_at(k)) for k, (rail, duration) in enumerate(points)
    )


def worn_bench(
    count: int, seed: int, *steps: Step, rails: Sequence[float] = TURN, durations: Sequence[float] = (1.4e-3,)
) -> Bench:
    """Injections of 30 % more nozzle area, in turn; steps: what becomes of the samples."""
    events = in_turn(count, lambda _: Faults(orifice_area=0.3), rails, durations)
    return Bench(Injector(), Needle(), events, seed=seed, around=Surroundings(after_noise=steps))


@cache
def run_plant(
    faults: Faults, events: int = EVENTS, stated: SizedEffect | None = None, laws: Laws = NO_LAWS
) -> ObservedRun:
    """Single injections at changing operating points; stated: an effect the observer's injector file has in force."""
    bench = Bench(Injector(), Needle(), in_turn(events, lambda _: faults), seed=5, laws=laws)
    observer = bench_at(bench.sample_rate)
    if stated is not None:
        observer = observer.with_parameters(with_effects(observer.injector.parameters, stated))
    run = observed(bench, observer)
    assert len(run.reports) == events
    return run
