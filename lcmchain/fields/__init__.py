"""Fields of a forming result: what they are, how they follow from positions, and their files.

    run ─▶ frames ─▶ dataset ─▶ netcdf_file (forming.nc) ─▶ whoever reads a result
           (FrameSeries,  │        vtu (ParaView)             (report, study, mapping, fmu)
            Histories)    │
                          ├─ table: every field declared once, with unit and meaning
                          ├─ derived, wrinkles, wrinkle_risk, between_plies: values at faces, nodes
                          ├─ stack: plies, and what lies over each other
                          ├─ history_group, stages: courses over time, parts of the process
                          └─ ugrid: meshes and variables as UGRID and CF want them

Of a result that stands, from its datasets:

- ``sheet.py``: positions, faces, areas and vectors as arrays;
- ``summary.py``: numbers and warnings of ``summary.json``, from ``loads.py`` (forces of tools and
  grippers, stops), ``limits.py`` (what fibres, law and contact allow) and ``crossings.py`` (a sheet
  that passes through itself);
- ``measures.py``: two results compared.
"""

import lazy_loader

# The names are those of the stub beside this file; each is imported when it is first asked for.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
