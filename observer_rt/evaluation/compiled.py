"""What is done at every sample that is evaluated, beside the observer. Compiled."""

import math

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.stream.stream import RING
from observer_rt.foundation.compiled import compiled
from observer_rt.foundation.continuity import Break
from observer_rt.foundation.small_arrays import copy_vector
from observer_rt.model.borrowed import borrowed
from observer_rt.model.forcing import borrowed_forcing, rate_after, under_terms
from observer_rt.model.integrator import Interval, advance_over
from observer_rt.observer.stream.state import Observer, State
from observer_rt.observer.stream.stepper import Stepper, coefficients_in_force, network_in_force

FOLLOWED = np.dtype([("position", np.int64), ("flows", np.bool_)], align=True)
_MASK = RING - 1
_NONE = int(Break.NONE)
_STARTING = int(State.STARTING)


@compiled
def nominal_rates(
    observer: Observer,
    nominal: Stepper,
    state: NDArray[np.void],
    held: NDArray[np.float64],
    first: int,
    rates: NDArray[np.float64],
) -> None:
    """Rates of the model as given [m3/s] at samples of an observer from the position `first` on.

    held: the model's state at state.position, up to which it was followed; it flows while its last rate is not 0.

    A needle that is shut with nothing flowing is passed over until it opens again or the line is at rest.
    """
    c, network, memory = coefficients_in_force(nominal), network_in_force(nominal), state[0]
    ring, x, forcing = observer.ring, borrowed(held), borrowed_forcing(nominal.of_hat)
    found = -1  # position of the state to go on from, if that is not x
    for place in range(rates.size):
        position = first + place
        row = ring[position & _MASK]
        rates[place] = 0.0
        if row.resting or row.broken != _NONE:
            memory.position = found = position
            memory.flows = False
        elif row.seat_area > 0.0 or memory.flows:
            if found >= 0:
                copy_vector(observer.x_tilde[found & _MASK], x)
                found = -1
            if position - memory.position >= RING:
                x.fill(np.nan)
                memory.position = position - 1
            for number in range(memory.position + 1, position + 1):
                before, after = ring[(number - 1) & _MASK], ring[number & _MASK]
                interval = Interval(
                    (before.rail_pressure, before.seat_area),
                    (after.rail_pressure, after.seat_area),
                    nominal.interval,
                    nominal.substeps,
                )
                forced = under_terms(x, interval, (before.lift_after, before.lift_area), c, network, forcing)
                advance_over(x, forced.interval, forced.knot, forced.coefficients, forced.network, None)
                rates[place] = rate_after(x, forced)
            memory.position = position
            memory.flows = rates[place] != 0.0
        if np.isnan(row.injection_rate):
            rates[place] = np.nan
    if found >= 0:
        copy_vector(observer.x_tilde[found & _MASK], x)


@compiled
def copy_indices(ring: NDArray[np.void], position: int, last: int, index: NDArray[np.int64]) -> bool:
    """Indices (n,) of samples from a position on; whether they rise, from `last` on, the one before them."""
    rises = True
    for number in range(index.size):
        index[number] = ring[(position + number) & _MASK].index
        rises &= index[number] > last
        last = index[number]
    return rises


@compiled
def begin_samples(held: NDArray[np.void], states: NDArray[np.void], time: NDArray[np.float64]) -> None:
    """Samples of which nothing is said yet, at times [s] (n,); held, states: as of `note_samples`."""
    for number in range(held.size):
        row = held[number]
        row.time = time[number]
        row.line_pressure = row.measured_rate = row.injection_rate = row.nominal_rate = np.nan
        row.injection_rate_sigma = np.nan
        row.valid = False
        row.state = _STARTING
    for number in range(states.size):
        states[number].x[:] = np.nan
        states[number].phi[:] = np.nan


@compiled
def note_samples(
    observer: Observer,
    position: int,
    first_index: int,
    nominal: NDArray[np.float64],
    held: NDArray[np.void],
    states: NDArray[np.void],
) -> None:
    """What the observer said of as many samples as `nominal` has, from a position of its ring on.

    held: `passage.HELD`, the first of them that of a sample index; samples of other indices are left out.
    states: `passage.STATES` of the same samples, none where they are not wanted.
    """
    for number in range(nominal.size):
        row = observer.ring[(position + number) & _MASK]
        place = row.index - first_index
        if not 0 <= place < held.size:
            continue
        here = held[place]
        here.line_pressure = np.nan if row.interpolated else row.line_pressure
        here.injection_rate = row.injection_rate
        here.nominal_rate = nominal[number]
        here.valid = row.valid
        here.state = row.state
        if states.size and not np.isnan(row.injection_rate):
            copy_vector(observer.x_hat[(position + number) & _MASK], states[place].x)
            copy_vector(row.phi, states[place].phi)


@compiled
def area(values: NDArray[np.float64]) -> float:
    """Under evenly spaced values (n,), by trapezoids a unit wide."""
    if values.size == 0:
        return 0.0
    total: float = -0.5 * (values[0] + values[-1])
    for value in values:
        total += value
    return total


@compiled
def rms_difference(values: NDArray[np.float64], others: NDArray[np.float64]) -> float:
    """Root of the mean square of their differences; (n,), nan without any."""
    total = 0.0
    for number in range(values.size):
        total += (values[number] - others[number]) ** 2
    return math.sqrt(total / values.size) if values.size else math.nan


@compiled
def mean_flowing(values: NDArray[np.float64], rate: NDArray[np.float64]) -> float:
    """Mean of values (n,) where a rate (n,) is not 0; nan if it is everywhere."""
    total = 0.0
    count = 0
    for number in range(values.size):
        if rate[number] != 0.0:
            total += values[number]
            count += 1
    return total / count if count else math.nan
