"""What all tests share: the same random examples every time, and no more of them than asked for."""

from hypothesis import settings

settings.register_profile("house", derandomize=True, deadline=None, print_blob=False)
settings.load_profile("house")
