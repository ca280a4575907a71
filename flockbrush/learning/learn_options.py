"""Options of learning, and checks of them before the work begins."""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path

from flockbrush.engine.files import output_problems, refused, sha256_of
from flockbrush.engine.problems import ProblemsError
from flockbrush.film.looking import Looking
from flockbrush.film.media import is_picture
from flockbrush.film.observations import Evidence
from flockbrush.film.track_files import is_tracks
from flockbrush.learning.helpers import Helpers
from flockbrush.learning.herd_views import followed
from flockbrush.learning.learned_brush import name_of
from flockbrush.learning.model_choice import AUTO, check_kind
from flockbrush.learning.regions import Region, regions_of
from flockbrush.learning.report_folder import folder_problems
from flockbrush.learning.which_model import HERD
from flockbrush.learning.words_of_tracks import of_tracks
from flockbrush.output.figures import drawing_problems
from flockbrush.runs.cluster import Cluster, Tls
from flockbrush.runs.terminal import say

QUICK_STARTS = 2
OF_HERD = {  # options that do nothing for other models, and why
    "workers": "the model {} is fitted locally; only the herd model can use a cluster",
    "resume": "only the search of the herd model is kept, and the model is {}",
    "ablate": "it leaves out parts of the herd model, and the model is {}",
    **dict.fromkeys(
        ("thorough", "starts", "beta", "device"), "it is for the search of the herd model, and the model is {}"
    ),
}
OF_FRAMES = {  # options that do nothing for one picture, and why
    "share": "it is one picture, and no frames can be held out",
    "beside": "it is one picture, and brushes are judged by frames",
    "ablate": "it is one picture, and parts are judged by frames",
    "beta": "it is one picture, and its density alone is learned from",
}


@dataclass
class LearnOptions:
    """Options of a user."""

    clips: list[Path]
    out: Path
    looking: Looking = field(default_factory=Looking)
    beta: float = 0.5
    seed: int = 0
    starts: int = 5
    model: str = AUTO
    jobs: int = 1
    workers: tuple[str, Tls] | None = None  # of a cluster, instead of processes
    share: float = 0.5  # of a clip that is learned from
    report: Path | None = None
    ablate: tuple[str, ...] = ()
    speed: float | None = None
    length_m: float | None = None
    licence: str | None = None
    resume: bool = False
    quick: bool = False
    thorough: bool = False
    beside: bool | None = None  # judge it beside the shipped brushes; None: unless quick
    json: bool = False
    device: str = "auto"
    command: str = ""
    crew: Cluster | None = None  # `workers`, while they are in use
    helpers: Helpers = field(default_factory=Helpers)  # `jobs`, begun already or while they are in use
    silent: bool = False  # no tables; the result is for a program
    told: frozenset[str] = frozenset()  # options of the command line, be it what they are by default

    def given(self, name: str) -> bool:
        """Whether an option is given, or differs from its default."""
        return name in self.told or getattr(self, name) != {one.name: one.default for one in fields(self)}[name]


def brush_files(wishes: LearnOptions, regions: Sequence[Region]) -> list[Path]:
    """The brushes that are written."""
    return [region_out(wishes.out, region) for region in regions] or [wishes.out]


def region_out(out, region: Region) -> Path:
    """The brush of a region."""
    return out.with_name(f"{name_of(out)}-{region.word}.brush.toml")


def state_of(out, number=0) -> Path:
    """Where the learning of the so-manieth part of a brush keeps what it has, to go on after an interruption."""
    return out.with_name(f"{name_of(out)}.learning{number + 1 if number else ''}")


def checked(wishes: LearnOptions) -> list[Region]:
    """The regions of the mask, when all that can be known to be wrong is right; ProblemsError."""
    name, looking = name_of(wishes.out), wishes.looking
    check_kind(wishes.model)
    _check_together(wishes)
    regions = regions_of(looking.regions) if looking.regions else []
    if regions and len(wishes.clips) > 1:
        raise refused(looking.regions, "a region mask can only be used with one clip, got several")
    outs = brush_files(wishes, regions)
    for out in outs:
        name_of(out)
    inputs = [*wishes.clips, *(p for p in (looking.regions, looking.obstacles) if p)]
    problems = output_problems(outs, inputs)
    if wishes.report is not None:
        parts = map(name_of, outs) if regions else ()
        problems += folder_problems(wishes.report, parts) or drawing_problems(wishes.report)
    if wishes.resume and not any(state_of(out).exists() for out in outs):
        missing = f"there is no interrupted learning of {name} to continue; leave out --resume"
        problems += refused(state_of(outs[0]), missing).problems
    if problems:
        raise ProblemsError(problems)
    _check_different(wishes.clips)
    _tell_ignored(wishes)
    return regions


def _tell_ignored(wishes):
    """Report options that do nothing for these files; for films this is known after tracking."""
    ignored = "--speed was ignored: it is for photographs; in a clip, speed is measured"
    for clip in filter(Path.is_file, wishes.clips if wishes.speed is not None else ()):
        if is_tracks(clip) or not is_picture(clip):
            say(f"{clip}: {of_tracks(ignored) if is_tracks(clip) else ignored}")
    if all(map(is_tracks, wishes.clips)):
        _tell_of_followed(wishes)


def _tell_of_followed(wishes):
    for name in filter(wishes.given, ("beta", "device")):
        say(f"--{name} was ignored: it is for learning from fields alone, and single animals are followed here")


def _check_together(wishes):
    """Refuse options that contradict one another, or that do nothing beside others."""
    if wishes.quick and wishes.thorough:
        raise refused("--thorough", "it searches longer and --quick shorter; use one of them")
    if wishes.quick and wishes.given("starts") and wishes.starts > QUICK_STARTS:
        say(f"--starts {wishes.starts} is cut to {QUICK_STARTS}: --quick fits no more random starts")
    if wishes.given("share") and len(wishes.clips) > 1:
        raise refused("--share", f"of {len(wishes.clips)} files each is held out in turn; it is for one file")
    for name, told in OF_HERD.items():
        if wishes.given(name) and wishes.model not in (HERD, AUTO):
            option = {"workers": "cluster"}.get(name, name)
            raise refused(f"--{option}", told.format(wishes.model))


def check_photo(clip, wishes: LearnOptions):
    """Refuse options that do nothing for one picture; ProblemsError."""
    for name in filter(wishes.given, OF_FRAMES):
        raise refused(clip, f"{OF_FRAMES[name]}: leave out --{name}")


def _check_different(clips):
    """Refuse the same clip twice: what is held out would be learned from."""
    known: dict[str, Path] = {}
    for clip in map(Path, clips if len(clips) > 1 else ()):
        what = sha256_of(clip) if clip.is_file() else str(clip.resolve())
        if what in known:
            same = f"has the same content as {known[what].name}: each file is held out in turn, name it once"
            raise refused(clip, same)
        known[what] = clip


def check_fields(evidences: Sequence[Evidence], wishes: LearnOptions):
    """Refuse, in plain words, what cannot be done without torch: learning from fields alone; ProblemsError.

    Where single animals are followed, say which options do nothing.
    """
    if all(followed(evidence) for evidence in evidences):
        if not all(map(is_tracks, wishes.clips)):  # of these it is told
            _tell_of_followed(wishes)
        return
    if importlib.util.find_spec("torch") is None:
        raise refused(
            evidences[0].name,
            "single animals could not be separated; learning from fields alone needs torch, which is not installed: "
            'pip install "flockbrush[learn]"',
        )
    from flockbrush.learning.torch_herd import missing_device

    problem = missing_device(wishes.device)
    if problem:
        raise refused("--device", problem)
