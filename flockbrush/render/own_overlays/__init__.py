"""Overlays, one in a file; each registers itself (`flockbrush.render.overlay_registry.overlay`)."""
