"""Arguments and options that several commands have."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

SceneFile = Annotated[Path, typer.Argument(metavar="SCENE", help="Scene file (TOML).")]
OutFolder = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Folder of the results; default results/<scene>."),
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
    typer.Option("--out", metavar="DIR", help="Folder of the results; default results/NAME."),
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
