"""All twins of a law of fabrics that have names: with a coupling, locking, a constant C33, curves.

Each takes the place of the published law where a scene states what it knows, so that kernels hold
nothing else. The names of twins tell in which order they are made. Of all of them twins with
friction, or that depend on rates, can be made on demand (:mod:`lcmchain.materials.twins`).
"""

from __future__ import annotations

from typing import Any

from lcmchain.materials.bending_curve import bent_class
from lcmchain.materials.compaction import linear_class
from lcmchain.materials.pressure_table import tabled_class
from lcmchain.materials.shear_compaction import coupled_class
from lcmchain.materials.shear_locking import locking_class
from lcmchain.materials.twins import let_have_twins


def name_twins(law_class: Any, module: dict[str, Any]) -> None:
    """Make all twins of a class of laws, as globals of its module.

    Parameters
    ----------
    module : the globals of the module of the class, where compiled kernels on disk look them up.
    """
    classes = [law_class, coupled_class(law_class), tabled_class(law_class)]
    for twin in (locking_class, linear_class, bent_class):
        classes += [twin(own) for own in classes]
    module.update({own.__name__: own for own in classes})
    let_have_twins(*classes)
