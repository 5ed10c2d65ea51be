"""Which reasons are true of what. By name: a reason that only a later observer gives can stand here before it."""

ALWAYS = frozenset({"REVISED"})  # says what the observer did; cannot be untrue
LINE = frozenset(
    {"CONTRADICTED"}
)  # "the line pressure has left what the model can do: check sensors, cables"
OFFSET = frozenset({"PRESSURE_OFFSET", "CONTRADICTED"})
OUTLIERS = frozenset({"SAMPLES_LOST", "CONTRADICTED", "INPUT_FROZEN", "INPUT_CLIPPED"})
LATE_LINE = frozenset({"TIME_BASE", "SENSOR_LAG"})
LATE = frozenset({"TIME_BASE"})
LIFT = frozenset({"LIFT_SENSOR"})  # "check the lift sensor": none of today's says so
LIFT_ZERO = LIFT | {"NEEDLE_STUCK"}  # "check ... its offset" is true once the zero seems an open needle
CHANGE = frozenset({"SUDDEN_CHANGE"})
CROWDED = frozenset({"STARTING"})  # "wait for 3 ms of closed needle"
