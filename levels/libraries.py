"""Which brushes, species and programs a level can name."""

from __future__ import annotations

from pathlib import Path, PurePosixPath
from types import MappingProxyType

from flockbrush.behaviours.program import ProgramLibrary, shipped_programs
from flockbrush.levels.level_files import MemoryFiles, project_folder


def brush_library(path, files=None):
    """Every brush and species a level can name: its own files, ``brushes`` and ``species`` beside it, the shipped.

    Parameters
    ----------
    path : path-like
        The level.
    files : dict of str to bytes, optional
        `Level.files`, for brushes the level names as files.
    """
    path = Path(path)
    return _library_of((path.parent.resolve(), project_folder(path)), files or {})


def library_for_file(file):
    """Every brush and species for the file of a brush or a program: of its folder, the one above and the shipped."""
    file = Path(file)
    here = file.parent.resolve()
    return _library_of((here, here.parent, project_folder(file)))


def _library_of(folders, files=MappingProxyType({})):
    """The brushes and species of the folders ``brushes`` and ``species`` in some folders, and the shipped."""
    from flockbrush.behaviours.brush import SUFFIX, BrushLibrary, shipped
    from flockbrush.behaviours.species import SpeciesLibrary, shipped_species

    around = list(dict.fromkeys(folders))
    own = [folder / "brushes" for folder in around]
    embedded = {name: data for name, data in files.items() if name.endswith(SUFFIX)}
    species = SpeciesLibrary([*(folder / "species" for folder in around), *shipped_species().folders])
    return BrushLibrary([*(f for f in own if f.is_dir()), *shipped().folders], embedded, species=species)


def program_library(files):
    """The programs a level can name: of its own folders ``programs`` and the shipped, or those of a recording.

    A level that is not as the disk has it has those that were kept, too.
    """
    recorded = isinstance(files, MemoryFiles)
    library = ProgramLibrary([*([] if recorded else program_folders(files.level)), *shipped_programs().folders])
    kept = files.files if recorded else getattr(files, "kept", {})
    embedded = {name: data for name, data in kept.items() if name.endswith(library.suffix)}
    lost = {name for name in embedded if recorded or library.file_called(PurePosixPath(name).name) is None}
    return ProgramLibrary(library.folders, {name: embedded[name] for name in lost})


def put_brush(files, name, source) -> list[str]:
    """Give a level's files {name: bytes} a brush, in the place of all of its name; which were there with other bytes.

    A level may name a brush as a file of any folder, and a name stands for one brush.
    """
    base = f"{name}.brush.toml"
    there = [file for file in files if PurePosixPath(file).name == base]
    others = [file for file in there if files[file] != source]
    files.update(dict.fromkeys(there or [f"brushes/{base}"], source))
    return others


def programs_for_file(file):
    """The programs that the file of one can name: of its own folder, those of its project and the shipped."""
    here = Path(file).resolve().parent
    return ProgramLibrary([*dict.fromkeys((here, *program_folders(file))), *shipped_programs().folders])


def input_files(path, names) -> list[Path]:
    """Files that a level at ``path`` reads, by their names in it: beside the level or in its project."""
    folders = dict.fromkeys((Path(path).parent.resolve(), project_folder(path)))
    return [file for folder in folders for name in names if (file := folder / name).is_file()]


def program_folders(path):
    """Folders ``programs`` beside a level and in its project."""
    path = Path(path)
    own = [folder / "programs" for folder in dict.fromkeys((path.parent.resolve(), project_folder(path)))]
    return [folder for folder in own if folder.is_dir()]


def recorded_library(files):
    """The brushes a recording has embedded, and the shipped for what it has not."""
    from flockbrush.behaviours.brush import PATH_SUFFIX, SUFFIX, BrushLibrary, shipped
    from flockbrush.behaviours.species import SpeciesLibrary, shipped_species

    species = SpeciesLibrary(shipped_species().folders, files)
    brushes = {name: data for name, data in files.items() if name.endswith((SUFFIX, PATH_SUFFIX))}
    return BrushLibrary(shipped().folders, brushes, species=species)
