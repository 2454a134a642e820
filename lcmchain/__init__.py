"""Forming simulation of engineering textiles, and the chain of stages that follows it."""

from __future__ import annotations

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
    from importlib import import_module

    value = getattr(import_module(_HOME_OF_NAME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
