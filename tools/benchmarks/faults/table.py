"""The one table of everything that may go wrong, by name."""

from tools.benchmarks.faults import bench, frames, player, sensors
from tools.benchmarks.faults.fault import Fault

TABLE: dict[str, Fault] = {row.name: row for part in (sensors, bench, frames, player) for row in part.ROWS}
