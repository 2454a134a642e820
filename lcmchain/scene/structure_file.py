"""Read the file of a structural analysis: what ``[mapping.structure]`` holds, on its own."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from pathlib import Path

from pydantic import ValidationError

from lcmchain.errors import InputError
from lcmchain.quantities.entry_types import FROM_FILE
from lcmchain.scene.explain import MOST_PROBLEMS, problems_of
from lcmchain.scene.overrides import apply_overrides
from lcmchain.scene.read import input_error, parse_toml, read_text, require_within_limits
from lcmchain.scene.structure import Structure

# Where the table stands in a scene.
_PLACE = ("mapping", 0, "structure")


def read_structure(path: str | Path, overrides: Sequence[str] = ()) -> Structure:
    """Read and validate the file of a structural analysis (TOML).

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
        raise InputError("is a folder; name the file of the analysis in it", file=path)
    return structure_from_text(read_text(path), path, overrides)


def structure_from_text(
    text: str, path: Path | None = None, overrides: Sequence[str] = ()
) -> Structure:
    """Validate the text of the file of a structural analysis.

    Raises
    ------
    InputError : as in :func:`read_structure`.
    """
    data = parse_toml(text, path)
    if overrides:
        apply_overrides(data, overrides)
    require_within_limits(data, path)
    try:
        return Structure.model_validate(copy.deepcopy(data), context=FROM_FILE)
    except ValidationError as error:
        problems = problems_of(error, {"mapping": [{"structure": data}]}, _PLACE)
        unexplained = max(error.error_count() - MOST_PROBLEMS, 0)
        raise input_error(problems, path, unexplained=unexplained) from None
