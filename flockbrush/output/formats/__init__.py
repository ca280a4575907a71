"""One module per export format; the folder is scanned (`flockbrush.output.exporter.exporters`)."""
