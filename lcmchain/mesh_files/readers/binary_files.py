"""What libraries of binary files raise, told as errors of the input."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from lcmchain.errors import InputError


@contextmanager
def only_sound(title: str, path: Path) -> Iterator[None]:
    """Tell what goes wrong within the block as damage of the file.

    Parameters
    ----------
    title : of the format, as ``"MED"``.

    Raises
    ------
    InputError : the one of the block, or one with what h5py, netCDF4 or numpy said of the file.
    """
    try:
        yield
    except InputError:
        raise
    except Exception as error:  # the libraries raise what the damage makes of the file
        raise InputError(
            f"cannot read the mesh: no sound {title} file ({' '.join(str(error).split())[:200]})"
            "; export it again",
            file=path,
        ) from None
