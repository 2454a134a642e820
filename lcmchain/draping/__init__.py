"""Kinematic draping: a pin-jointed net of inextensible fibres laid onto the surface of a tool.

    scene ─▶ surface ─▶ start ─▶ laid (net.py lays it) ─────────┬─▶ drape: Draped ─▶ result
            (level)     (seed)    └▶ courses: strips and joints ┘                    (datasets)

Files are named after these steps.
"""

import lazy_loader

# The names are those of the stub beside this file; each is imported when it is first asked for.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
