"""The page of the result's fields, from the field table."""

from __future__ import annotations

from lcmchain.fields.saved import HISTORY_FIELDS
from lcmchain.manual.tables import code, markdown_table
from lcmchain.quantities.fields import FIELDS, Field

HEAD = """# Fields

Every field of `forming.nc`, `forming.vtu` and the files of mapped meshes, with its unit and its
definition. A vector stands as three scalars that end in `_x`, `_y` and `_z`. A result holds the
fields that its element and its scene define: the 2D approach has no thickness, and permeabilities
need a `[permeability]` table; a law with memory adds what it remembers, under its own names. How
the files are built is said in [Run and check](run.md#what-comes-out).
"""


HISTORIES = """## Histories

In the group `/history`, over `history_time` and, but for the energies, over `tool`. The interval is
`output.history_interval`; a sample lies at the step nearest to its multiple. `history_energy_` and
the name of a part of the [energy balance](time-integration.md#energy-balance) is that part, and
`history_energy_mass_damping` what of the damping is not that of contacts. `tool_force`,
`tool_travel` and `energy_*` without `history_` are those of the saved frames, and of their last
step alone.
"""


def field_page() -> str:
    """Return the page as Markdown."""
    parts = [HEAD]
    for location, title in (("face", "Fields of the faces"), ("node", "Fields of the nodes")):
        rows = [_row(field) for field in FIELDS.values() if field.location == location]
        parts += [f"## {title}\n", markdown_table(("field", "unit", "meaning"), rows)]
    rows = [_row(field) for field in HISTORY_FIELDS.values()]
    parts += [HISTORIES, markdown_table(("field", "unit", "meaning"), rows)]
    return "\n".join(parts)


def _row(field: Field) -> tuple[str, str, str]:
    name = code(field.name) + (" (vector)" if field.is_vector else "")
    return name, field.units, field.meaning
