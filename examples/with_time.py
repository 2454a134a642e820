"""The process with a time, of which tables of the manual were measured.

The scenes of this folder leave their time out. What a time, a damping or added mass does can only
be shown of a process that has one: scripts whose tables stand in the manual take these entries
first, and what a case of a table changes comes after them.
"""

from __future__ import annotations

_PROCESS = ("process.time=200 ms", "process.mass_damping=200 1/s")
#: Overrides, by the folder of the scene.
ENTRIES = {
    "hemisphere_holder": (
        *_PROCESS,
        "process.fibre_modulus_factor=1",
        "tools.holder.motion.ramp=10 ms",
    ),
    "hemisphere_free": _PROCESS,
    "stl_tool": _PROCESS,
}


def entries_with_time(folder: str) -> tuple[str, ...]:
    """Return the overrides of the scene in a folder of this name; none for other scenes."""
    return ENTRIES.get(folder, ())
