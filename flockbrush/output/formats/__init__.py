"""One file for each kind of export; the folder is scanned (`flockbrush.output.exporter.exporters`)."""
