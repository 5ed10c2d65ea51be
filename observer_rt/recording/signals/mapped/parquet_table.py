"""Parquet with columns of any names."""

from collections.abc import Iterator
from pathlib import Path

from observer_rt.config.recording import RecordingConfig
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.misspelt import hint
from observer_rt.recording.signals.mapped.table import TIME, Part, Table
from observer_rt.recording.signals.parquet_file import batches, opened_parquet


class ParquetTable(Table):
    """Columns by their names; units from the fields' metadata `unit`. A column of calendar stamps is in seconds."""

    def __init__(self, path: Path, config: RecordingConfig) -> None:
        super().__init__(path, config)
        mapped = self.mapped_columns()
        with opened_parquet(path) as file:
            schema = file.schema_arrow
        for column in mapped.values():
            if column.name not in schema.names:
                raise UserError(
                    str(path),
                    f"column '{column.name}' is missing{hint(column.name, schema.names)}",
                    "name the columns in [recording] of the bench file as the file does: it has "
                    f"{', '.join(schema.names[:40])}",
                )
        self._names = {name: column.name for name, column in mapped.items()}
        self.columns = {field.name: _unit(field.metadata) for field in schema}
        self.units = {name: unit for name, column in self._names.items() if (unit := self.columns[column])}
        kind = str(schema.field(self._names[TIME]).type)
        if kind.startswith(("timestamp", "duration")):
            self.units[TIME] = "s"
        self.rasters = (tuple(name for name in mapped if name != TIME),)
        self.layout = f"Parquet, {len(schema.names)} columns"

    def parts(self, raster: int) -> Iterator[Part]:
        """Batches of rows."""
        for columns in batches(self.path, list(dict.fromkeys(self._names.values()))):
            signals = {name: columns[column] for name, column in self._names.items()}
            yield Part(signals.pop(TIME), signals)

    def place(self, row: int, raster: int) -> str:
        """By its number."""
        return f"{self.path}, row {row}"


def _unit(metadata: dict[bytes, bytes] | None) -> str:
    found = (metadata or {}).get(b"unit", b"")
    return found.decode("utf-8", "replace").strip()
