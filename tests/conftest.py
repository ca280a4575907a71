"""What all tests share: the same random examples every time, no more of them than asked for; files stay together."""

import gc
import os

import pytest
from hypothesis import settings

settings.register_profile("house", derandomize=True, deadline=None, print_blob=False)
settings.load_profile("house")
gc.disable()  # until all tests are found: what is imported stays
os.fsync = lambda file: None  # no file of a test has to outlive a power failure

FIRST = "test_replaying.py"  # the longest: it compiles every kernel twice, once for a plain processor
WITHOUT_HERDS = ("levels", "components", "engine")  # rooms whose tests need few kernels, or others
FILMS = ("test_observe.py", "test_bodies.py", "test_lift.py", "test_v_rules.py", "test_formation_extraction.py")  # too
WITH_HERDS = ("test_editor.py", "test_tiled_project.py")  # in spite of its room


SMOKE = {  # pytest -m smoke: files, and how the names of the tests begin; "" means all of a file
    "test_commands.py": "",
    "test_noise.py": "",
    "test_schedule.py": "",
    "test_state.py": "",
    "test_world.py": "",
    "test_models.py": ("test_gives_one_unit", "test_turns_with", "test_forgets"),
    "test_measures.py": "",
    "test_grid.py": "",
    "test_visibility.py": ("test_two_animals", "test_the_one_in", "test_a_wall"),
    "test_level_writer.py": "",
    "test_golden_hashes.py": ("test_every_shipped", "test_a_level_is_after_ten_seconds_what_it_was[meadow]"),
    "test_library.py": "",
    "test_command_line.py": ("test_every_command", "test_the_version"),
    "test_window_app.py": ("test_it_opens", "test_what_is_painted", "test_undo"),
    "test_house.py": ("test_every_room", "test_the_rules"),
}


@pytest.fixture(scope="module")
def hasty_learning():
    """`flockbrush learn` searches from four starts for a second, in one process, and tests the brush in one way."""
    from flockbrush.learning import helpers, learn, recipe

    workers, begins = recipe.Workers, recipe.begins
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recipe, "begins", lambda *how: begins(*how)[::5][:4])
        patch.setattr(recipe, "Workers", lambda given, jobs, *rest: workers(given, 1, *rest))
        patch.setattr(helpers, "MOST", 1)  # lambdas below are not pickled
        patch.setattr(learn, "QUICK_BUDGET", 1.0)
        patch.setattr(learn, "with_other_numbers", lambda *_: [])
        patch.setattr(learn, "with_other_starts", lambda *_: [])
        yield


@pytest.fixture(scope="module")
def short_trials():
    """Herds are not run on for long after their clip; not for workers of a cluster, which know nothing of it."""
    from flockbrush.learning import trials, verdict

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(trials, "BEYOND", (2.0, 2.0))
        patch.setattr(verdict, "ALONE", 8.0)
        patch.setattr(verdict, "MEASURED", 4.0)
        yield


def _is_smoke(item):
    wanted = SMOKE.get(item.path.name)
    return wanted is not None and item.name.startswith(wanted)


def pytest_collection_modifyitems(items):
    """The longest file first, and last those that another process can run while the kernels are being compiled."""
    for item in filter(_is_smoke, items):
        item.add_marker(pytest.mark.smoke)
    items.sort(key=lambda item: (item.path.name != FIRST, _without_herds(item.path)))


def pytest_collection_finish():
    gc.freeze()  # not looked through again and again
    gc.enable()


def _without_herds(path):
    return path.name in FILMS or (path.parent.name in WITHOUT_HERDS and path.name not in WITH_HERDS)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """The tests of a file go to one process: herds are set up once.  The first process begins with the first file, the
    others with the last, so that they do not compile the same kernels at the same time."""
    from xdist.scheduler import LoadFileScheduling

    class FromBothEnds(LoadFileScheduling):
        def _assign_work_unit(self, node):
            if node is not self.nodes[0]:
                self.workqueue.move_to_end(next(reversed(self.workqueue)), last=False)
            super()._assign_work_unit(node)

    gc.enable()  # this process finds no tests itself
    config.option.loadscopereorder = False  # files in the order of their tests
    return FromBothEnds(config, log)
