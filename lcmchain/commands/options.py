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
Strict = Annotated[
    bool, typer.Option("--strict", help="Take warnings as errors: exit code 1 where there are any.")
]
