"""CSV export: one row per animal and frame."""

from __future__ import annotations

from flockbrush.output.exporter import Exporter, exporter


@exporter(".csv")
class Csv(Exporter):
    """CSV table with six decimals; metadata in ``NAME.csv.json`` beside it."""

    contents = "one row per animal and frame; units in NAME.csv.json"
    opens_in = "pandas, R, Excel, flockbrush play"

    _ROW = "%d,%.6f,%d,%.6f,%.6f,%.6f,%.6f,%.6f,%.6f,%.6f,%.6f,%s,%s,%s,%d"

    @classmethod
    def beside(cls, path):
        from flockbrush.film.track_table import about_file

        return [about_file(path)]

    def open(self):
        from flockbrush.output.trajectory_table import COLUMNS

        self._file = open(self.temporary, "w", encoding="utf-8", newline="", buffering=1 << 20)
        self._row = self._ROW + ",%s" * (len(COLUMNS) - self._ROW.count("%") - 2) + ",%.6f,%.6f\n"
        self._file.write(",".join(COLUMNS) + "\n")

    def take(self, moment):
        import numpy as np

        from flockbrush.output.trajectory_table import quoted, table_of

        table, words = table_of(self.simulation, moment, self.frames)
        for name in ("x", "y", "z", "vx", "vy", "vz", "heading", "speed", "pitch", "length"):
            table[name] = np.round(table[name], 6) + 0.0  # no "-0.000000"
        for name, texts in words.items():
            fields = [quoted(word) for word in texts]
            table[name] = [fields[k] for k in table[name]]
        columns = [column if isinstance(column, list) else column.tolist() for column in table.values()]
        self._file.writelines(map(self._row.__mod__, zip(*columns, strict=True)))
        self.frames += 1

    def finish(self):
        from flockbrush.output.trajectory_table import metadata_of, names_in_tables, write_about

        self._file.close()
        about = metadata_of(self.simulation, self.fps) | {"frames": self.frames, **names_in_tables(self.simulation)}
        write_about(self.path, about)

    def let_go(self):
        self._file.close()
