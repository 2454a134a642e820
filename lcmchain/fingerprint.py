"""What decides the numbers of a forming run, as hashes: a saved state must not outlive any of it.

Recorded as ``run_fingerprint`` in ``summary.json``, in checkpoints and in the saved states of
forming units. It is not ``scene_sha256``, the hash of the text of a scene file, which a scene
built in Python does not have and which says nothing about the files that a scene names.
"""

from __future__ import annotations

import hashlib
import json
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from lcmchain.compilation.cache import source_hash
from lcmchain.errors import InputError

# Tables of a scene that are applied to the saved frames, after forming; its title; and how it would
# be draped, which no run with checkpoints is.
AFTER_FORMING = {"title", "output", "mapping", "permeability", "infiltration", "fmu", "draping"}


class Fingerprint(NamedTuple):
    """Hashes of the parts that decide the numbers of a forming run.

    scene : of the validated values, in SI; of a scene built in Python as of one from a file.
    files : of the contents of the mesh files that its tools name, and of what the drawings of its
        blanks hold.
    sources : of the source files of lcmchain. A version would not tell two states of a
        development install apart. Processor and numba may change the last bits and are left out.
    """

    scene: str
    files: str
    sources: str

    @property
    def sha256(self) -> str:
        """Hash of all parts."""
        return hashlib.sha256(json.dumps(self).encode()).hexdigest()

    def difference(self, other: Fingerprint) -> str:
        """Say in words what differs from another run, empty if nothing does."""
        words = {
            "scene": "another scene (or other --set values)",
            "files": "other contents of the mesh files of its tools, or of its drawings",
            "sources": "other source files of lcmchain",
        }
        mine, others = self._asdict(), other._asdict()
        return " and ".join(text for part, text in words.items() if mine[part] != others[part])


def run_fingerprint(scene: Any) -> Fingerprint:
    """Return the fingerprint of the forming run of a scene.

    Entries that are applied to the saved frames (title, ``[output]``, ``[[mapping]]``,
    ``[permeability]``, ``[infiltration]``, ``[fmu]``) are left out: a finished forming run serves a
    changed mapping. So is ``[draping]``, except where the blank is draped. An infiltration that
    goes on while the blank is formed counts.

    Raises
    ------
    InputError : a file that a tool names cannot be read.
    """
    values = json.dumps(forming_values(scene), sort_keys=True)
    return Fingerprint(
        scene=hashlib.sha256(values.encode()).hexdigest(),
        files=_file_hash(scene),
        sources=_sources(),
    )


def forming_values(scene: Any) -> dict[str, Any]:
    """Return the entries of a scene that decide the numbers of its forming run, in plain values."""
    values: dict[str, Any] = scene.model_dump(mode="json", exclude=AFTER_FORMING)
    values["history_interval"] = scene.history_interval  # the one entry of [output] that forms
    if scene.element.type == "kinematic":
        values |= scene.model_dump(mode="json", include={"draping"})
    if scene.wet_forming is not None:
        forms = ("infiltration", "permeability")
        values |= scene.model_dump(mode="json", include=set(forms))
    return values


@cache
def _sources() -> str:
    """Hash of the sources when this process first asked: a unit asks at every instantiation."""
    return source_hash()


def _file_hash(scene) -> str:
    digest = hashlib.sha256()
    for tool in scene.tools:
        name = getattr(tool.shape, "file", None)
        if name is None:
            continue
        path = Path(scene.source.directory) / name
        try:
            with open(path, "rb") as file:
                digest.update(hashlib.file_digest(file, "sha256").digest())
        except OSError as error:
            raise InputError(f"cannot be read: {error.strerror}", file=path) from None
    for blank in (scene.blank, *scene.plies):
        if blank is not None and blank.drawing is not None:
            digest.update(json.dumps(blank.shape).encode())
    return digest.hexdigest()
