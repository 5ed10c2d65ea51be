"""Which reasons are true of what, by name."""

ALWAYS = frozenset({"REVISED"})  # says what the observer did; cannot be untrue
SENSOR = frozenset(
    {"CONTRADICTED"}
)  # "the line pressure has left what the model can do: check sensors, cables"
OFFSET = SENSOR | {"PRESSURE_OFFSET"}
OUTLIERS = SENSOR | {"SAMPLES_LOST"}
FROZEN = OUTLIERS | {"INPUT_FROZEN"}
CLIPPED = SENSOR | {"INPUT_CLIPPED"}
DROPOUTS = FROZEN | CLIPPED
LATE = SENSOR | {"TIME_BASE"}
LATE_LINE = LATE | {"SENSOR_LAG"}
LATE_LIFT = LATE | {"LIFT_SENSOR_LAG"}
LIFT_ZERO = SENSOR | {
    "LIFT_ZERO",
    "NEEDLE_STUCK",
}  # a zero far off seems an open needle: "check ... its offset"
CHANGE = frozenset({"SUDDEN_CHANGE"})
CROWDED = frozenset(
    {"STARTING", "NO_STANDSTILL", "TOO_FEW_EVENTS"}
)  # "wait for 3 ms of closed needle"; too few were judged yet, for a judgement takes as long as before
