"""Elements of the sheet: strains, internal forces, and the bound of their frequency.

    element.type of a scene ─▶ families ─▶ solid_shell, or membrane_shell ─▶ a body
                                                                               │
                   model, solver and fields ask ◀── family: what every body answers

``blocks`` lays elements out in lanes, ``vectors`` has the arithmetic of their kernels.
``pressed_elements`` are those that a pressure acts on, ``fibre_volume`` is the guard against more
fibre than space.
"""
