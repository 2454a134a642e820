"""The fields of an infiltration, declared as data: name, unit, place and meaning."""

from __future__ import annotations

from lcmchain.fields.table import FACE, NODE, Field

_FIELDS = (
    Field(
        "resin_pressure", "Pa", "pressure of the resin", NODE,
        "in the resin; where no resin is, that of the air",
    ),
    Field(
        "fill_factor", "1", "fill factor", NODE,
        "volume of resin per pore volume of the control volume of the node",
    ),
    Field(
        "fill_time", "s", "fill time", NODE,
        "time at which the front passed the node; not a number where it is dry",
    ),
    Field(
        "resin_mass", "kg", "resin mass", NODE,
        "resin in the control volume of the node: the sum over the nodes is that in the part",
    ),
    Field(
        "degree_of_cure", "1", "degree of cure", NODE,
        "of the resin at the node, carried along by the flow",
    ),
    Field("resin_temperature", "K", "temperature of the resin", NODE, "of the resin at the node"),
    Field(
        "resin_film",
        "m",
        "thickness of the resin film",
        NODE,
        "of the resin that lies on the preform",
    ),
    Field(
        "darcy_velocity", "m s-1", "Darcy velocity", FACE,
        "volume of resin per time and area of the cross-section, - K grad p / viscosity, in the "
        "plane of the face: the resin itself is faster by one over the porosity",
        is_vector=True,
    ),
    Field(
        "flow_medium_fill_factor", "1", "fill factor of the flow medium", NODE,
        "resin over pore volume in the layer above the node; not a number where there is none",
    ),
    Field(
        "flow_medium_fill_time", "s", "fill time of the flow medium", NODE,
        "time at which the front passed in the layer above the node; not a number where it is dry",
    ),
    Field(
        "flow_medium_pressure", "Pa", "pressure in the flow medium", NODE,
        "of the resin, or of the air where the layer above the node is dry",
    ),
    Field(
        "flow_medium_resin_mass", "kg", "resin mass in the flow medium", NODE,
        "in the layer above the node: none of the resin in the part",
    ),
    Field(
        "pressed_thickness", "m", "thickness under what presses on the part", FACE,
        "of the part between closing tools or under a bag",
    ),
    Field(
        "pressed_fibre_volume_fraction", "1", "fibre volume fraction under what presses", FACE,
        "of the part between closing tools or under a bag",
    ),
)  # fmt: skip

#: Fields of an infiltration by name.
FILLING_FIELDS: dict[str, Field] = {field.name: field for field in _FIELDS}
