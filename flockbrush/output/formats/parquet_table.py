"""Parquet export: the table of the CSV export with exact numbers."""

from __future__ import annotations

import json

from flockbrush.output.exporter import Exporter, exporter


@exporter(".parquet")
class Parquet(Exporter):
    """A table for large runs: exact numbers, metadata in the schema and the file."""

    contents = "the same table as .csv with exact numbers, units in the schema"
    opens_in = "pandas, polars, DuckDB, R arrow"
    needs = (("pyarrow", "pyarrow"),)
    _ROWS = 1 << 18  # in memory before they are written

    def open(self):
        import pyarrow as pa
        import pyarrow.parquet as pq

        from flockbrush.output.trajectory_table import TEXTS, columns_of, metadata_of

        self._pa, self._waiting, self._rows = pa, [], 0
        words = pa.dictionary(pa.int32(), pa.string())
        kinds = {"frame": pa.int32(), "id": pa.int64(), "reference": pa.int64()}
        kinds |= dict.fromkeys(TEXTS, words)
        schema = pa.schema([(name, kinds.get(name, pa.float64())) for name in columns_of(self.simulation)])
        about = {key: str(value) for key, value in metadata_of(self.simulation, self.fps).items()}
        self._writer = pq.ParquetWriter(self.temporary, schema.with_metadata(about), compression="zstd")
        self._schema = self._writer.schema

    def take(self, moment):
        from flockbrush.output.trajectory_table import table_of

        pa = self._pa
        table, words = table_of(self.simulation, moment, self.frames)
        arrays = {name: pa.array(values) for name, values in table.items() if name not in words}
        for name, texts in words.items():
            codes = pa.array(table[name].astype("int32"))
            arrays[name] = pa.DictionaryArray.from_arrays(codes, pa.array(texts, pa.string()))
        self._waiting.append(pa.Table.from_arrays([arrays[name] for name in self._schema.names], schema=self._schema))
        self._rows += len(moment)
        self.frames += 1
        if self._rows >= self._ROWS:
            self._write()

    def _write(self):
        if self._waiting:
            whole = self._pa.concat_tables(self._waiting).unify_dictionaries()
            self._writer.write_table(whole, row_group_size=self._ROWS)
        self._waiting, self._rows = [], 0

    def finish(self):
        from flockbrush.output.trajectory_table import names_in_tables

        self._write()
        about = {"frames": self.frames, **names_in_tables(self.simulation)}
        self._writer.add_key_value_metadata({key: json.dumps(value) for key, value in about.items()})
        self._writer.close()

    def let_go(self):
        self._writer.close()
