"""Simulated recordings for notebooks: rail pressures and durations in, a recording with its truth out."""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import pandas as pd

from observer_rt.config.bench import load_injector
from observer_rt.desk.library.notes import naming_parameters
from observer_rt.desk.simulation import schedule as times
from observer_rt.desk.simulation.simulate import OPTION as EFFECT_OPTION
from observer_rt.desk.simulation.simulate import SAMPLE_RATE_OPTION, SimulatedNoise, parse_effects, printed_truth
from observer_rt.desk.simulation.simulate import simulate as simulated
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.units import MILLISECOND

if TYPE_CHECKING:
    from observer_rt.desk.library.injector import Injector

_PARAMETERS = {
    times.RAIL_PRESSURE_OPTION: "rail_pressure_MPa",
    times.ENERGIZING_TIME_OPTION: "energizing_ms",
    times.INJECTIONS_OPTION: "injections",
    times.PERIOD_OPTION: "period_ms",
    SAMPLE_RATE_OPTION: "sample_rate_Hz",
    EFFECT_OPTION: "effects",
}


def simulate(
    injector: "Injector | None" = None,
    rail_pressure_MPa: float | Sequence[float] = 100.0,  # noqa: N803 - units as printed
    energizing_ms: float | Sequence[float] = 1.9,
    injections: int = 10,
    period_ms: float = 60.0,
    sample_rate_Hz: float = 100e3,  # noqa: N803
    effects: Mapping[str, float | Mapping[str, float]] | None = None,
    noise: bool = True,
    measured_rate: bool = False,
    seed: int = 0,
) -> tuple[Recording, pd.DataFrame]:
    """Simulate a healthy or worn injector.

    Parameters
    ----------
    injector : Injector, optional
        Model; without one the nominal injector.
    rail_pressure_MPa, energizing_ms : float or list of them
        Events take them in turn.
    injections : int
        Number of events.
    period_ms : float
        Time from event to event.
    sample_rate_Hz : float
        Of all signals.
    effects : dict, optional
        Sizes by id, or by id and parameter, in the units of `observer-rt effects`, such as `{"orifice_area": 0.3}` or
        `{"orifice_area": {"v_H": 0.3}}`.
    noise : bool
        Whether signals have noise and the resolution of the bus.
    measured_rate : bool
        Whether the recording has a measured injection rate, with its errors.
    seed : int
        Of the noise.

    Returns
    -------
    recording : Recording
        As sensors would give it.
    truth : DataFrame
        What nobody can measure.

    Raises
    ------
    UserError
        For an effect or a schedule that cannot be.
    """
    parameters = load_injector() if injector is None else injector.parameters
    with naming_parameters(_PARAMETERS):
        schedule = times.make_schedule(
            times.parse_rail_pressures(_as_text(rail_pressure_MPa)),
            injections,
            period_ms * MILLISECOND,
            times.parse_energizing_times(_as_text(energizing_ms)),
        )
        sizes = parse_effects([text for entry in (effects or {}).items() for text in _effect_texts(*entry)])
        levels = SimulatedNoise() if noise else None
        made = simulated(parameters, schedule, sample_rate_Hz, sizes, levels, measured_rate, seed)
    return made.recording, pd.DataFrame(printed_truth(made.truth))


def _as_text(values: Any) -> str:
    """Numbers as the command line has them, where their limits are."""
    is_sequence = isinstance(values, Iterable) and not isinstance(values, str)
    return ",".join(map(str, values)) if is_sequence else str(values)


def _effect_texts(effect: str, sizes: float | Mapping[str, float]) -> list[str]:
    """An effect as the command line has it."""
    if isinstance(sizes, Mapping):
        return [f"{effect}:{name}={size}" for name, size in sizes.items()] or [effect]
    return [f"{effect}={sizes}"]
