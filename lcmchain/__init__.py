"""Forming simulation of engineering textiles, and the chain of stages that follows it.

::

    scene.toml ─▶ scene ─▶ model ─▶ solver ─▶ fields ─▶ forming.nc ─┬▶ report, judgements
                             ▲       (state)                        ├▶ pattern
       mesh, elements, materials, effects, interfaces, tools        └▶ mapping, coupling, fmu

- ``pipeline`` is this way from a scene to its files, ``forming_run`` the part of it from saved
  frame to saved frame. ``stages`` says what a model is in each stage of the process. ``summary``
  and ``provenance`` are what a run says of itself.
- Beside it: ``check`` before a run, ``draping`` in place of forming, ``statics`` for equilibria,
  ``study`` for runs with many settings, ``coupons`` and ``identification`` for fabrics, ``bench``
  and ``verification`` for the program itself.
- To call it: ``cli`` and ``commands``; ``manual``.
- Under all of it: ``errors``, ``atomic`` (files), ``text_files``, ``quantities``, ``mesh_files``,
  ``results`` (folders), ``thresholds``.
- Compiled code: ``compilation`` changes numba, ``jit`` has the options of all compiled functions,
  ``dispatch`` the functions that answer by class, ``packs`` eight numbers as one value.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

from lcmchain.compilation.cache import use_source_keyed_cache

__version__ = "0.1.0"

__all__ = ["Result", "Scene", "read_scene", "run"]

# First of all: numba reads the cache folder when it is imported.
use_source_keyed_cache()

# Public names and where they live; loaded on first use so that `import lcmchain` stays quick.
_HOME_OF_NAME = {
    "Result": "lcmchain.pipeline",
    "Scene": "lcmchain.scene",
    "read_scene": "lcmchain.scene",
    "run": "lcmchain.pipeline",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF_NAME:
        raise AttributeError(f"module 'lcmchain' has no attribute {name!r}")
    value = getattr(import_module(_HOME_OF_NAME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
