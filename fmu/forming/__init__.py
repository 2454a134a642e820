"""The unit of a forming simulation.

    scene ─▶ scene_parameters.py (entries that a master may set) ─▶ variables.py: the interface
    inputs ─▶ part.py (FormingPart) ─▶ outputs ─▶ interface.py: from elements to patches
                └▶ frames, saved on the way and written as forming.nc at the end

The unit is built by :func:`lcmchain.fmu.build.build_fmu`.
"""
