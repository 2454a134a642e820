"""The files of a run: which it reads, and which it will write."""

from __future__ import annotations

from pathlib import Path

from lcmchain.errors import InputError
from lcmchain.report.style import CAPTIONS, START_PICTURE
from lcmchain.results.folder import SUMMARY_FILE
from lcmchain.results.log import LOG_FILE
from lcmchain.scene import Scene
from lcmchain.scene.draping import courses_to_lay

#: Files that a run writes under names of its own; each mapping adds files of its name.
OWN_FILES = ("forming.nc", "forming.vtu", "forming.pvd", "report.html", SUMMARY_FILE, LOG_FILE)
#: Tables of a draped ply and of the joints of its courses, and what a course's pattern begins with.
PLY_TABLE, JOINT_TABLE, COURSE_FILE = "draping.csv", "joints.csv", "course_"
MAPPED_SUFFIXES = (".nc", ".vtu", ".png", ".json")
STRUCTURAL_ENDINGS = tuple(
    f"_calculix{ending}"
    for ending in (".inp", "_mesh.inp", "_sections.inp", ".nc", ".vtu", ".png", ".json", ".frd",
                   ".dat", ".log")
)  # fmt: skip
FILLING_ENDINGS = tuple(
    f"_filling{ending}"
    for ending in (".nc", ".vtu", ".pvd", ".json", "_time.png", "_pressure.png", "_curves.png",
                   "_checkpoint.npz")
)  # fmt: skip


def input_files(scene: Scene) -> list[Path]:
    """Return the files that a run reads."""
    directory = Path(scene.source.directory)
    scene_file = [scene.source.path] if scene.source.path is not None else []
    return [*scene_file, *(directory / name for _, name in scene.source.files)]


def expected_files(scene: Scene) -> list[str]:
    """Return the names that a run writes, as far as the scene tells them."""
    mapped = [
        f"{target.name}{end}"
        for target in scene.mapping
        for end in (
            *MAPPED_SUFFIXES,
            *([".pvd"] if target.all_frames else []),
            *(["_errors.png"] if target.verify else []),
        )
    ]
    analysed = [
        f"{target.name}{end}"
        for target in scene.mapping
        if target.structure is not None
        for end in STRUCTURAL_ENDINGS
    ]
    filled = [
        f"{name}{end}"
        for name, (case, _) in scene.infiltrations.items()
        for end in (
            *FILLING_ENDINGS,
            *([f"_filling.{case.animation}"] if case.animation != "none" else []),
        )
    ]
    return [*OWN_FILES, *_draped_files(scene), *mapped, *analysed, *filled]


def _draped_files(scene: Scene) -> list[str]:
    """Return what a run writes beside the fields where the blank is draped."""
    if scene.element.has_forces:
        return []
    patterns = [
        f"{COURSE_FILE}{course.name}.{end}"
        for course in courses_to_lay(scene.draping, scene.stack)
        for end in ("csv", "dxf")
    ]
    return [PLY_TABLE, *([JOINT_TABLE] if patterns else []), *patterns]


def require_free_names(scene: Scene) -> None:
    """Refuse a mapping whose files would take the names of the run's own.

    Raises
    ------
    InputError : names the mapping.
    """
    taken = {Path(name).stem for name in (*OWN_FILES, *CAPTIONS, START_PICTURE)}
    for index, target in enumerate(scene.mapping):
        if target.name in taken:
            raise InputError(
                f'files of the run itself are named "{target.name}"; choose another name',
                key=f"mapping[{index}].name",
            )
