"""USD: the scene of a run (`flockbrush.output.formats.usd_scene` is the exporter)."""
