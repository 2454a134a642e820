"""Fields of a forming result: how they follow from positions, and their files.

They are declared in :mod:`lcmchain.quantities.fields`.

    run ─▶ saved ─▶ dataset ─▶ netcdf_file (forming.nc) ─▶ whoever reads a result
         (FrameSeries, │        vtu (ParaView)             (report, study, mapping, fmu)
          Histories)   │
                       ├─ derived, wrinkles, between_plies: values at faces and nodes
                       ├─ stack: plies, and what lies over each other; courses of a ply
                       ├─ stages: stages of the process, springback
                       └─ ugrid: meshes and variables as UGRID and CF want them

Numbers are taken from the datasets of a result, be it new or read from its file:

- ``sheet.py``: positions, faces, areas and vectors as arrays;
- ``summary.py``: numbers of ``summary.json``;
- ``loads.py``: forces of tools and grippers, and what stopped a tool.

Whether these numbers are good is judged in :mod:`lcmchain.judgements`.
"""

import lazy_loader

# The names are those of the stub beside this file; each is imported when it is first asked for.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
