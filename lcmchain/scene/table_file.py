"""Read a file that holds one table of a scene on its own: the case of a stage."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from lcmchain.errors import InputError
from lcmchain.quantities.entry_types import FROM_FILE
from lcmchain.quantities.scene_model import SceneModel
from lcmchain.scene.explain import MOST_PROBLEMS, problems_of
from lcmchain.scene.overrides import apply_overrides
from lcmchain.scene.read import input_error, parse_toml, read_text, require_within_limits

Table = TypeVar("Table", bound=SceneModel)


def read_table(
    model: type[Table], stage: str, path: str | Path, overrides: Sequence[str] = ()
) -> Table:
    """Read and validate a file (TOML) with what ``[mapping.STAGE]`` holds in a scene.

    Parameters
    ----------
    overrides : ``key=value`` texts, as for a scene.

    Raises
    ------
    InputError : the file cannot be read, is not TOML, or any entry is wrong; all wrong entries are
        named in one message.
    """
    path = Path(path)
    if path.is_dir():
        raise InputError("is a folder; name the file of the case in it", file=path)
    return table_from_text(model, stage, read_text(path), path, overrides)


def table_from_text(
    model: type[Table],
    stage: str,
    text: str,
    path: Path | None = None,
    overrides: Sequence[str] = (),
) -> Table:
    """Validate the text of such a file.

    Raises
    ------
    InputError : as in :func:`read_table`.
    """
    data: dict[str, Any] = parse_toml(text, path)
    if overrides:
        apply_overrides(data, overrides)
    require_within_limits(data, path)
    try:
        return model.model_validate(copy.deepcopy(data), context=FROM_FILE)
    except ValidationError as error:
        # where the table stands in a scene
        problems = problems_of(error, {"mapping": [{stage: data}]}, ("mapping", 0, stage))
        unexplained = max(error.error_count() - MOST_PROBLEMS, 0)
        raise input_error(problems, path, unexplained=unexplained) from None
