"""One file per drive.

A new drive is a new file here, or an entry point of the group ``flockbrush.drives``.
"""
