"""One file per behaviour model.

A new model is a new file here, or an entry point of the group ``flockbrush.behaviours``.
"""
