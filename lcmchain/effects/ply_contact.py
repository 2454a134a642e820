"""Contact between the plies of a stack: they press, stick, slide and part.

Adds: forces between the faces of two plies that meet: nodes of each face on the facets of the other
one, both ways, with half the stiffness each; and what the laws of the interfaces add up to:
friction, a viscous film, adhesion, a shear stress (:mod:`lcmchain.interfaces.laws`). Springs of the
nodes are frozen for some tens of steps, so that they have a potential, and renewed as the plies
slide (:mod:`lcmchain.interfaces`).
Source: node-to-facet penalty contact, e.g. Wriggers, "Computational Contact Mechanics", sections
6.5 and 9; depths that go to zero by augmented Lagrange multipliers, section 6.3.3.
Stability limit: ω² of the springs, bounded by the row sums of M⁻¹K, is added to that of the
elements; damping along the normals, a few percent of critical, adds its rate.
Scene: ``layup`` or ``[[plies]]``, and ``[[interfaces]]``.
Fields: ``ply_pressure_top``, ``ply_shear_stress_top``, ``ply_gap_top``, ``slip_top``,
``slip_path_top``, ``ply_contact_top``, ``faced_ply_top`` and those of the lower face;
``energy_contact``, ``energy_friction`` (history).
"""

from __future__ import annotations

from lcmchain.effects.effect import Effect, EffectModel, range_in_words


def active(model: EffectModel) -> list[Effect]:
    """Return contact and friction between plies; nothing for one sheet without one of its own."""
    contact = model.ply_contact
    if contact is None:
        if len(model.bodies) < 2:
            return []
        return [Effect("contact between plies", False, "they pass through each other")]
    stiffness = range_in_words(1e-9 * contact.data.penalty)
    effects = [Effect("contact between plies", True, f"stiffness {stiffness} N/mm^3")]
    with_itself = [
        body.name for ply, body in enumerate(model.bodies) if contact.data.interface[ply, ply] >= 0
    ]
    if with_itself:
        effects.append(Effect("contact of a ply with itself", True, f"of {', '.join(with_itself)}"))
    # the places for laws that no interface uses have nothing to say
    laws = [law for law in contact.laws if hasattr(law, "title")]
    return [*effects, *(Effect(law.title(), True, law.reason()) for law in laws)]
