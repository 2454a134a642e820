"""Arguments and options that several commands have, and the folders of their results."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from functools import wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from lcmchain.atomic import protecting
from lcmchain.errors import InputError


def takes_options(command: Callable[..., None]) -> Callable[..., None]:
    """Let a command take each field of its dataclass parameters as an option of its own.

    The options stand where the parameter stands. The fields are annotated as options are.
    """
    annotations = get_type_hints(command, include_extras=True)
    groups: dict[str, type] = {}
    parameters = []
    for name, parameter in signature(command).parameters.items():
        annotation = annotations[name]
        if not is_dataclass(annotation):
            parameters.append(parameter.replace(annotation=annotation, kind=Parameter.KEYWORD_ONLY))
            continue
        assert isinstance(annotation, type)
        groups[name] = annotation
        types = get_type_hints(annotation, include_extras=True)
        parameters += [
            Parameter(
                field.name, Parameter.KEYWORD_ONLY, default=field.default,
                annotation=types[field.name],
            )
            for field in fields(annotation)
        ]  # fmt: skip

    @wraps(command)
    def with_options(**values: object) -> None:
        for name, group in groups.items():
            values[name] = group(**{field.name: values.pop(field.name) for field in fields(group)})
        command(**values)

    with_options.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    with_options.__annotations__ = {p.name: p.annotation for p in parameters}
    return with_options


def results_option(default: str) -> Any:
    """Return the option of a command's folder of results; ``default`` is its name in results."""
    text = f"Folder of the results; default results/{default}."
    return typer.Option("--out", "-o", metavar="DIR", help=text)


SceneFile = Annotated[Path, typer.Argument(metavar="SCENE", help="Scene file (TOML).")]
OutFolder = Annotated[
    Path | None,
    results_option("<scene>"),
]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Replace a scene entry, as in --set tools.punch.friction=0.2; may be repeated.",
    ),
]
ModelRung = Annotated[
    str | None,
    typer.Option(
        "--model",
        metavar="RUNG",
        help="Take another model than the scene: kinematic, membrane, membrane-shell or "
        "solid-shell; what it knows nothing of is left out.",
    ),
]
Strict = Annotated[
    bool, typer.Option("--strict", help="Take warnings as errors: exit code 1 where there are any.")
]
Results = Annotated[
    Path | None,
    results_option("NAME"),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Say nothing but warnings and errors.")]

# How a forming result is mapped.
MaximumDistance = Annotated[
    str | None,
    typer.Option(metavar="LENGTH", help='Farthest distance to map over, such as "2 mm".'),
]
LengthUnit = Annotated[str, typer.Option(help="Unit of the target mesh.")]
Method = Annotated[str, typer.Option(help="Weights: overlap or closest.")]
SavedFrame = Annotated[
    int, typer.Option(metavar="N", help="Saved frame to map, from 0; -1 is the last one.")
]
SavedTime = Annotated[
    str | None,
    typer.Option(metavar="TIME", help='Saved state to map by its time, such as "120 ms".'),
]
Register = Annotated[
    bool, typer.Option("--register", help="Bring the mesh to the sheet by a small rigid motion.")
]
ThicknessLimit = Annotated[
    float, typer.Option(help="Largest relative difference of a solid's thickness from the formed.")
]
AllowAmbiguous = Annotated[
    bool, typer.Option("--allow-ambiguous", help="Accept the nearer of two layers.")
]
AllowIncomplete = Annotated[
    bool, typer.Option("--allow-incomplete", help="Accept fields of an unfinished run.")
]


# --- folders of results ---------------------------------------------------------------------------


def default_out(scene: Path) -> Path:
    """Name the folder of the results: ``results/`` and the name of the scene (or of its folder)."""
    name = scene.resolve().parent.name if scene.stem == "scene" else name_of_input(scene)
    return Path("results") / (name or "scene")


def name_of_input(path: Path) -> str:
    """Return the name of an input for its results.

    What comes by <(...) of a shell has the number of a file descriptor for a name, which may be
    another each time: it is named as what comes by /dev/stdin.
    """
    return "stdin" if path.parent.name == "fd" and path.name.isdecimal() else path.stem


@contextmanager
def output_folder(folder: Path, *, inputs: Iterable[Path | None] = ()) -> Iterator[Path]:
    """Make the folder of the results and prove that it can be written to, before any work.

    When the work then finds wrong input, folders made here that are still empty are removed.

    Parameters
    ----------
    inputs : files that the work reads and must not write over.

    Raises
    ------
    InputError : the folder cannot be made or written to, or the work would write over an input.
    """
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        _remove_empty(made)
        reason = "it is a file" if folder.is_file() else error.strerror or str(error)
        raise InputError(
            f"results cannot be written here ({reason}); name another folder with --out",
            file=folder,
        ) from None
    try:
        with protecting(file for file in inputs if file is not None):
            yield folder
    except BaseException:
        _remove_empty(made)
        raise


def _remove_empty(folders: list[Path]) -> None:
    for folder in folders:  # innermost first
        try:
            folder.rmdir()
        except OSError:
            return
