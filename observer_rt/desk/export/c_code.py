"""C99 of a frozen observer: sources that are the same for all, and its numbers and laws."""

import math
from collections.abc import Iterator, Mapping, Sequence
from importlib.resources import files

import numpy as np

from observer_rt import __version__
from observer_rt.core.model.model import steps_in
from observer_rt.core.stream.stream import (
    CONFIRM,
    LOOK_BACK,
    LOWEST,
    MAX_EVENT,
    RING,
    SHORT,
    SLOWEST_OPENING,
)
from observer_rt.desk.export.frozen import Frozen
from observer_rt.desk.export.laws import CLaws, c_laws, real
from observer_rt.model.line.wave import WaveLine

LIBRARY = ("front_end.c", "forcing.c", "injector.c", "law_parts.c", "model.c", "observer.c")
HEADERS = ("forcing.h", "front_end.h", "injector.h", "laws.h", "model.h", "observer.h", "real.h", "sensor.h")
PARAMETERS, NUMBERS, LAWS, REPLAY = "parameters.h", "parameters.c", "laws.c", "replay.c"
_COLUMNS = 110


def c_sources(frozen: Frozen, single: bool) -> Mapping[str, str]:
    """Files by name; those ending in .c are to be compiled, `replay.c` with them for the reference run."""
    line = "line_wave.c" if isinstance(frozen.line, WaveLine) else "line_lump.c"
    laws = c_laws(frozen.terms, frozen.known)
    found = {name: source(name) for name in (*HEADERS, *LIBRARY, line, REPLAY)}
    found[PARAMETERS] = "\n".join(_parameters(frozen, laws, single)) + "\n"
    found[NUMBERS] = "\n".join(_numbers(frozen)) + "\n"
    found[LAWS] = "\n".join(_laws(laws)) + "\n"
    return found


def source(name: str) -> str:
    """Text of a source that is the same for all."""
    return (files("observer_rt.desk.export") / "sources" / name).read_text(encoding="utf-8")


def _heading(purpose: str) -> str:
    return f"/* {purpose}; written by observer-rt {__version__}. */"


def _parameters(frozen: Frozen, laws: CLaws, single: bool) -> Iterator[str]:
    yield _heading(f"Numbers of {frozen.name}")
    yield from (
        "#ifndef PARAMETERS_H",
        "#define PARAMETERS_H",
        "",
        f"#define OBSERVER_SINGLE {int(single)}",
        "",
    )
    yield from ('#include "real.h"', "")
    for name, value in _reals(frozen).items():
        yield f"#define {name} {real(value)}"
    yield ""
    for name, count in _counts(frozen, laws).items():
        yield f"#define {name} {count}"
    yield from (
        "",
        "typedef struct {",
        *(f"    real_t {name};" for name in frozen.line._fields),
        "} Line;",
        "",
    )
    yield f"#define LINE_VALUES {_braced(frozen.line)}"
    yield f"#define LEARNED_BIAS {_braced(frozen.network.bias)}"
    yield f"#define LEARNED_NOZZLE {_braced(frozen.network.nozzle)}"
    yield ""
    yield "extern const real_t INJ_HIDDEN_LAYER[NEURONS][6];"
    yield "extern const real_t INJ_OUTPUT_LAYER[2][NEURONS];"
    yield "extern const real_t INJ_GAINS[GAIN_ROWS][STATES]; /* by samples since the start */"
    yield from ("", "#endif")


def _reals(frozen: Frozen) -> Mapping[str, float]:
    c, inputs, sensor = frozen.constants.coefficients, frozen.constants.inputs, frozen.sensor
    return {
        "SAMPLE_INTERVAL": frozen.constants.interval,
        "PRESSURE_SCALE": c.pressure_scale,
        "FLOW_SCALE": c.flow_scale,
        "AREA_SCALE": c.area_scale,
        "CHAMBER_PRESSURE": c.chamber_pressure,
        "ORIFICE_TRANSITION": c.nozzle.transition,
        "NOZZLE_FLOW": c.nozzle.flow,
        "CRITICAL_EXCESS": c.nozzle.critical_excess,
        "VAPOUR_MARGIN": c.nozzle.vapour_margin,
        "CHAMBER_RISE": c.nozzle.chamber_rise,
        "CHAMBER_RISE_WITH_SEAT": c.nozzle.chamber_rise_with_seat,
        "SEAT_DIAMETER": c.seat.diameter,
        "SEAT_HALF_CONE_ANGLE": c.seat.half_cone_angle,
        "SEAT_LOSS": c.seat.loss,
        "SEAT_LOSS_LIFT": c.seat.loss_lift,
        "SAC_A5": c.sac.a5,
        "SAC_A6": c.sac.a6,
        "RAIL_FACTOR": inputs.rail_factor,
        "RAIL_SHIFT": inputs.rail_shift,
        "LIFT_FACTOR": inputs.lift_factor,
        "LIFT_SHIFT": inputs.lift_shift,
        "LIFT_ZERO": 0.0,
        "OPENS_ABOVE": frozen.opens_above,
        "SHUTS_BELOW": frozen.shuts_below,
        "SLOWEST_OPENING": SLOWEST_OPENING,
        "LOWEST_LIFT": LOWEST,
        "SENSOR_LAG": sensor.lag,
        "SENSOR_OFFSET": sensor.offset,
        "SENSOR_FRACTION": sensor.fraction,
        "INNOVATION_WEIGHT": frozen.weight,
    }


def _counts(frozen: Frozen, laws: CLaws) -> Mapping[str, str]:
    it = frozen.constants
    timing, steps = it.timing, steps_in(it.interval)
    before = max(timing.ramp + 4, -it.sensor.late + 1)
    ring = 1 << math.ceil(math.log2(timing.lookahead + before + 1))
    counts = {
        "STATES": it.coefficients.states,
        "SUBSTEPS": it.substeps,
        "NEURONS": frozen.network.hidden.shape[0],
        "GAIN_ROWS": len(frozen.gains),
        "LIFT_RING": ring,
        "LOOKAHEAD": timing.lookahead,
        "RECORDED_LATE": max(it.sensor.late, 0),
        "RECORDED_EARLY": max(-it.sensor.late, 0),
        "TOE": timing.toe,
        "RAMP": timing.ramp,
        "REACH": LOOK_BACK + timing.confirm - 1,
        "CONFIRM_OPEN": timing.confirm,
        "CONFIRM_SHUT": CONFIRM,
        "BOUNCE": timing.bounce,
        "SETTLE": timing.settle,
        "GOOD": timing.good,
        "MOST_OPEN": MAX_EVENT,
        "MOST_RESTLESS": MAX_EVENT + RING // 8,
        "MOST_LEAPING": min(timing.bridge, SHORT * timing.confirm),
        "LONG_AGO": 0x7FFFFFFF,
        "LAW_LAGS": max(laws.lags, 1),
        "LAW_RINGINGS": max(len(laws.ringings), 1),
    }
    if isinstance(frozen.line, WaveLine):
        counts["CELLS"] = int(frozen.line.cells)
        counts["LINE_STEPS"] = steps
        counts["END_STEPS"] = max(1, it.substeps // steps)
    switches = {
        "HAS_LAWS": bool(frozen.terms),
        "HAS_SENSOR_LAWS": bool(laws.of_sensor),
        "LAWS_READ_FLOWS": laws.reads_flows,
        "OFFSET_MOVES": frozen.offset_moves,
    }
    return {name: f"{count}U" for name, count in counts.items()} | {
        name: str(int(switch)) for name, switch in switches.items()
    }


def _numbers(frozen: Frozen) -> Iterator[str]:
    yield _heading(f"Tables of {frozen.name}")
    yield from ('#include "parameters.h"', "")
    tables = {
        "INJ_HIDDEN_LAYER[NEURONS][6]": frozen.network.hidden,
        "INJ_OUTPUT_LAYER[2][NEURONS]": frozen.network.output,
        "INJ_GAINS[GAIN_ROWS][STATES]": frozen.gains,
    }
    for name, table in tables.items():
        yield f"const real_t {name} = {{"
        for row in table:
            yield from _wrapped(f"    {_braced(row)},")
        yield "};"


def _braced(values: Sequence[float] | np.ndarray) -> str:
    return "{" + ", ".join(real(float(value)) for value in values) + "}"


def _wrapped(line: str) -> Iterator[str]:
    while len(line) > _COLUMNS and ", " in line[:_COLUMNS]:
        end = line.rindex(", ", 0, _COLUMNS) + 1
        yield line[:end]
        line = "     " + line[end:]
    yield line


def _laws(laws: CLaws) -> Iterator[str]:
    yield _heading("Laws in force, added up by the equation they correct")
    yield from ('#include "laws.h"', "")
    yield "static void begin(real_t totals[])"
    yield from (
        "{",
        "    for (uint32_t i = 0U; i < LAW_EQUATIONS; ++i) {",
        "        totals[i] = R(0.0);",
        "    }",
        "}",
    )
    for name, lines in (("model", laws.of_model), ("sensor", laws.of_sensor)):
        yield ""
        yield f"void inj_laws_of_{name}(const real_t v[], LawMemory *memory, real_t interval_ms, real_t totals[])"
        yield from ("{", "    (void)v;", "    (void)memory;", "    (void)interval_ms;", "    begin(totals);")
        for line in lines:
            yield from _wrapped(f"    {line}")
        yield "}"
    yield ""
    yield "real_t inj_laws_without_ringing(LawMemory *memory, real_t innovation, real_t interval_ms)"
    yield from ("{", "    real_t left = innovation;", "    (void)memory;", "    (void)interval_ms;")
    for place in laws.ringings_of_sensor:
        kilohertz, damping = map(real, laws.ringings[place])
        yield f"    left = inj_law_without(memory->notches[{place}], left, {kilohertz}, {damping}, interval_ms);"
    yield from ("    return left;", "}")
