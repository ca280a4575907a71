"""What all tests share: the same random examples every time, no more of them than asked for; files stay together."""

import pytest
from hypothesis import settings

settings.register_profile("house", derandomize=True, deadline=None, print_blob=False)
settings.load_profile("house")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """The tests of a file go to one process: kernels are compiled and herds set up once, not in every process."""
    from xdist.scheduler import LoadFileScheduling

    config.option.loadscopereorder = False  # the files with few, long tests are not kept for the end
    return LoadFileScheduling(config, log)
