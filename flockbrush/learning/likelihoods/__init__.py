"""One file per likelihood: estimation of the parameters of a model from the turns of animals.

A new one is a new file here, or an entry point of the group ``flockbrush.likelihoods``.
"""
