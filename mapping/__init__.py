"""Transfer of forming fields onto the meshes of later stages.

    forming result ─▶ sheet.py (Sheet)          target mesh ─▶ target/ (TargetMesh)
                          │   registration.py: how the two lie to each other   │
                          └───────────────┬────────────────────────────────────┘
                                          ▼
                 surfaces/ (shell cells), solids/ (solid cells)
                                          ▼
                                 weights.py (MappingWeights, stored and used again)
                                          ▼
                 fields.py (MappedFields of one ply), plies.py (plies of a stack)
                                          │   verify.py: the error that the mapping adds
                                          │   frames.py: all saved states, on a target that moves
                                          ▼
                 files.py (netCDF, VTU), report.py, picture.py, formats/ (other programs)

transfer.py has the two calls of the middle, compute_weights and transfer, for one ply and for
stacks; stage.py does all of it from files to files. structure/ goes on from a mapped file to a
solved part. interface.py is apart: the cells, or patches of them, at which a co-simulation gives
and takes fields. benchmark.py times the mapping beside another library.
"""

import lazy_loader

# The names are those of the stub beside this file; each is imported when it is first asked for.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
