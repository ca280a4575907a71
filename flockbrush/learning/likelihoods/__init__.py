"""One file per likelihood: how the numbers of a model are found from the turns of animals.

A new one is a new file here, or an entry point of the group ``flockbrush.likelihoods``.
"""
