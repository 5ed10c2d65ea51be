"""The feed line as a pipe in which pressure travels: cells that store fuel, and faces between them with its inertia.

Pressures p_1 .. p_n at i L/n, p_n at the closed end, the rail's p_0 in front; flows q_1 .. q_n at the faces before
them, half a step earlier. Stepped by `model.leapfrog`: with the right n, errors of space and time cancel. The end
cell is half a cell and the volume beyond. Waves are damped by a stress proportional to a cell's rate of compression,
as in a viscous fuel, in the end cell at the time of its flow: half a step later it acts as inertia and costs 1 % of
mass.

Friction at the wall depends on earlier changes of the flow (Zielke 1968): a thin boundary layer adds some percent to
the inertance. For times far shorter than R^2/nu_w its pull is sqrt(nu_w)/R times the changes of mean flow, weighted
by 2/sqrt(pi time), here a sum of exponentials.

x = [p_n, q_n, p_S, p_1 .. p_(n-1), q_1 .. q_(n-1), p_n a step before, w_1 .. w_k: the memory of the flow].
"""

import math

import numpy as np

from observer_rt.core.model import model
from observer_rt.foundation.units import MICROSECOND, Floats
from observer_rt.model.fuel import HIGHEST_PRESSURE, USUAL_PRESSURE
from observer_rt.model.line import at_closed_end
from observer_rt.model.parameters import FEWEST_CELLS, MOST_CELLS, WAVE_LINES, Departures, InjectorParameters

RESOLVED = 50e-6  # s, below which cells carry waves otherwise than a pipe; means over it are a pipe's
MOST_OF_A_STEP = 8  # implicit steps of the sac in one of the line's
STABLE = 0.98  # largest `strain`, crossed^2 + 2 damping step, of which 1 is the limit
HALF_WAY = 0.5  # of the length, where two parts meet whose file does not state it
DAMPING = 0.5  # m2/s, of a line whose file does not state it
FASTER = 3.3e-3  # s^1/2, integral of the weights that the sum lacks below .01 ms, as a part of the inertance


def before_at(cells: int) -> int:
    """Place in x of p_n a step before."""
    return 2 * cells + 1


def memory_at(number: int, cells: int) -> int:
    """Place in x of w_(number + 1)."""
    return 2 * cells + 2 + number


def pressure_at(cell: int, cells: int) -> int:
    """Place in x of p_i, i = 1 .. n."""
    return 0 if cell == cells else 2 + cell


def flow_at(face: int, cells: int) -> int:
    """Place in x of q_i, i = 1 .. n."""
    return 1 if face == cells else 1 + cells + face


class WaveLine(model.WaveLine):
    """A pipe as numbers, with the members of `LumpLine`."""

    __slots__ = ()
    kind = model.WAVE
    averaged = False
    resolved = RESOLVED
    of_stiffness = ("a1", "a2_nozzle", "a2_seat", "b", "b_near", "leak", "control_flow", "displaced", "expelled")
    of_inertance = ("a3", "a3_near", "a4", "a4_inlet")

    @property
    def further(self) -> int:
        """Number of states besides p_n and q_n."""
        return 2 * int(self.cells) - 1 + model.MEMORIES

    @classmethod
    def of(
        cls, parameters: InjectorParameters, departures: Departures, nozzle_flow: float, seat_flow: float
    ) -> "WaveLine":
        """The line of an injector; nozzle_flow, seat_flow: as of `LumpLine.of`."""
        fluid, line, scaling = parameters.fluid, parameters.line, parameters.scaling
        compliance = fluid.in_line.filling(USUAL_PRESSURE) / line.volume / scaling.pressure  # K_L/(V_L p_0), 1/m3
        inertia = line.area * scaling.pressure / (fluid.density_line * line.length * scaling.flow)
        memory = math.sqrt(line.wall_viscosity or 0.0) / (0.5 * line.diameter)
        inertia /= 1.0 + memory * FASTER
        # slope of a loss factor that acts on the whole line
        of_loss = scaling.flow / (2 * line.area * line.length) / fluid.in_line.density(USUAL_PRESSURE)
        damping = DAMPING if line.damping is None else line.damping
        cells = line.cells or cells_for(parameters, model.STEP)
        ratio, far = _parts(parameters)
        of_inertia, of_volume = _of_parts(ratio, far)
        end = compliance * of_volume * ratio * cells
        end /= 0.5 + of_volume * ratio * cells * (line.end_volume or 0.0) / line.volume
        return cls(
            **at_closed_end(parameters, departures, end, nozzle_flow, seat_flow),
            a3=cells * inertia * of_inertia,
            a3_near=cells * inertia * of_inertia / ratio,
            a4=line.loss_factor * of_loss,
            a4_inlet=cells * of_inertia * (line.inlet_loss_factor or 0.0) * of_loss,
            memory=memory,
            b=cells * compliance * scaling.flow * of_volume,
            b_near=cells * compliance * scaling.flow * of_volume * ratio,
            damping=damping * (cells / line.length) ** 2,
            cells=float(cells),
            joint=far * cells,
        )

    @property
    def crossing(self) -> float:
        """Rate [1/s] at which sound crosses cells, the same in both parts."""
        return math.sqrt(self.a3 * self.b)

    @property
    def mode(self) -> float:
        """Angular frequency [rad/s] of a quarter wave along the pipe."""
        return 0.5 * math.pi * self.crossing / self.cells

    @property
    def fastest(self) -> float:
        """Zero, for RK4 need not follow the line."""
        return 0.0

    @property
    def impedance(self) -> float:
        """p_L over x_2 of a wave that travels in the injector's part."""
        return math.sqrt(self.b_near / self.a3_near)

    @property
    def by_rail(self) -> Floats:
        result = np.zeros(3 + self.further)
        result[flow_at(1, int(self.cells))] = self.a3
        return result

    def substeps(self, of_sac: int, interval: float) -> int:
        """Implicit steps in a sample interval: a few in each step of the line if they resolve the sac, else one."""
        steps = model.steps_in(interval)
        substeps = math.ceil(of_sac / steps)
        return steps * (substeps if substeps <= MOST_OF_A_STEP else 1)

    def strain(self, interval: float) -> float:
        """As of `LumpLine`; of fuel that stiffens with pressure, at `HIGHEST_PRESSURE`."""
        step = interval / model.steps_in(interval)
        above = (HIGHEST_PRESSURE / USUAL_PRESSURE - 1.0) * (self.stiffness_pressure + self.chamber_pressure)
        stiffer = above * (self.stiffness_slope + self.stiffness_bend * above) if self.stiffness_bend else 0.0
        return float((1.0 + stiffer) * (self.crossing * step) ** 2 + 2.0 * self.damping * step)

    def stepping(self, interval: float) -> str:
        step = interval / model.steps_in(interval)
        return (
            f"a line of {self.cells:.0f} cells, of which sound crosses {self.crossing * step:.2g} in its step of "
            f"{step / MICROSECOND:.3g} us"
        )

    def further_variance(self, flow: float) -> Floats:
        cells = int(self.cells)
        pressures = np.full(cells - 1, flow * self.impedance**2)
        return np.concatenate([pressures, np.full(cells - 1, flow), np.zeros(1 + model.MEMORIES)])

    def transition(self, interval: float) -> tuple[Floats, Floats]:
        """Transition by the steps themselves, without friction."""
        steps = model.steps_in(interval)
        moved = np.linalg.matrix_power(self.one_step(interval / steps), steps)
        return moved[:-1, :-1], moved[:-1, -1]

    def one_step(self, step: float) -> Floats:
        """Matrix of the line at rest over one step [s], by its states and, last, the rail pressure."""
        n = int(self.cells)
        size = 2 * n + 1 + model.MEMORIES
        places = [*range(2), *range(3, size + 1)]  # of x without p_S, in rows of the matrix
        row = {place: k for k, place in enumerate(places)}
        flows = np.eye(size + 1)  # the rail pressure comes last
        pressures = np.eye(size + 1)
        for i in range(1, n + 1):
            q, p = row[flow_at(i, n)], row[pressure_at(i, n)]
            before = size if i == 1 else row[pressure_at(i - 1, n)]
            inertia = model.value_across_joint(self.joint - (i - 1), self.a3, self.a3_near)
            flows[q, before] += step * inertia
            flows[q, p] -= step * inertia
            for neighbour in {max(i - 1, 1), min(i + 1, n)} - {i}:
                flows[q, row[flow_at(neighbour, n)]] += step * self.damping
                flows[q, q] -= step * self.damping
            if i == n:
                stress = self.damping / self.b_near
                flows[q, p] -= stress
                flows[q, row[before_at(n)]] += stress
                pressures[row[before_at(n)]] = np.eye(size + 1)[p]
            if i < n:
                compliance = model.value_across_joint(self.joint - (i - 0.5), self.b, self.b_near)
                pressures[p, q] += step * compliance
                pressures[p, row[flow_at(i + 1, n)]] -= step * compliance
            else:
                pressures[p, q] += step * self.a1
        if self.memory > 0.0:
            self._drag(flows, [row[flow_at(i, n)] for i in range(1, n + 1)], row[memory_at(0, n)], step)
        else:
            flows[row[memory_at(0, n)] : size] = 0.0
        return np.asarray(pressures @ flows, np.float64)

    def _drag(self, flows: Floats, faces: list[int], first: int, step: float) -> None:
        """Add the friction at the wall to the matrix `flows` of a step [s]; faces: rows of q_i, first: row of w_1."""
        change = np.mean(flows[faces], axis=0)
        change[faces] -= 1.0 / len(faces)
        pull, by_change = np.zeros_like(change), 0.0
        for k in range(model.MEMORIES):
            by_memory, by_flow = model.pull_of(k, step, self.memory)
            pull[first + k] = by_memory
            by_change += by_flow
        shift = -step / (1.0 + step * by_change) * (pull + by_change * change)
        flows[faces] += shift
        for k in range(model.MEMORIES):
            keep, take = model.fading_of(k, step)
            flows[first + k] = take * (change + shift)
            flows[first + k, first + k] += keep

    def with_mean(self) -> "MeanWaveLine":
        return MeanWaveLine(*self)


class MeanWaveLine(WaveLine):
    """Wave line with the integral of p_L [s] as its last state: of p_L in the middle of every step."""

    __slots__ = ()
    averaged = True

    @property
    def further(self) -> int:
        """As of `WaveLine`, and the integral."""
        return super().further + 1

    def further_variance(self, flow: float) -> Floats:
        return np.append(super().further_variance(flow), 0.0)

    def transition(self, interval: float) -> tuple[Floats, Floats]:
        """As of `WaveLine`, with an integral that begins anew as the last state."""
        steps = model.steps_in(interval)
        step = interval / steps
        one_step = self.one_step(step)
        size = len(one_step)
        with_mean = np.zeros((size + 1, size + 1))  # the integral comes last, after the rail pressure
        with_mean[:size, :size] = one_step
        with_mean[size, :size] = 0.5 * step * (one_step[0] + np.eye(size)[0])
        with_mean[size, size] = 1.0
        moved = np.linalg.matrix_power(with_mean, steps)
        order = [*range(size - 1), size]
        matrix = moved[np.ix_(order, order)]
        matrix[:, -1] = 0.0
        return matrix, moved[order, size - 1]


def _parts(parameters: InjectorParameters) -> tuple[float, float]:
    """Ratio of the injector part's impedance to the rail part's, and the rail part's share of the length."""
    line = parameters.line
    ratio = 1.0 if line.impedance_ratio is None else line.impedance_ratio
    return ratio, HALF_WAY if line.impedance_step is None else line.impedance_step


def _of_parts(ratio: float, far: float) -> tuple[float, float]:
    """Slopes of flow and pressure in the rail part, over those of a uniform line of equal inertance and volume."""
    return far + (1.0 - far) * ratio, far + (1.0 - far) / ratio


def cells_for(parameters: InjectorParameters, step: float) -> int:
    """Number of cells with which errors of space and time cancel best at a step [s], stable at the highest pressure.

    Cells make short waves slower, and steps make up for c^2 of that, c the share of a cell that sound crosses in
    one; damping, taken at the start of a step, makes up for 6 nu step/h^2 of it, h the length of a cell.
    """
    fluid, line = parameters.fluid, parameters.line
    filling, highest = (fluid.in_line.filling(pressure) for pressure in (USUAL_PRESSURE, HIGHEST_PRESSURE))
    along = math.sqrt(filling * line.area / (line.volume * fluid.density_line * line.length))
    along *= math.sqrt(math.prod(_of_parts(*_parts(parameters))))
    fastest = along * math.sqrt(highest / filling)
    damping = DAMPING if line.damping is None else line.damping
    wanted = 1.0 / math.sqrt((along * step) ** 2 + 6.0 * damping * step / line.length**2)
    stable = math.sqrt(STABLE / ((fastest * step) ** 2 + 2.0 * damping * step / line.length**2))
    return max(FEWEST_CELLS, min(MOST_CELLS, round(wanted), int(stable)))


def with_cells(parameters: InjectorParameters) -> InjectorParameters:
    """Parameters that state the number of cells, so that effects on the speed of sound do not change it."""
    line = parameters.line
    if line.cells is not None or line.model not in WAVE_LINES:
        return parameters
    stated = line.model_copy(update={"cells": cells_for(parameters, model.STEP)})
    return parameters.model_copy(update={"line": stated})
