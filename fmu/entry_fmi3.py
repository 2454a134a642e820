"""Entry point of a unit of FMI 3.0; ``fmu/build.py`` copies this file into its resources.

pythonfmu3 runs it in the Python of the importing process, whose environment must have lcmchain.
"""

import lcmchain_unit_environment  # beside this file

lcmchain_unit_environment.prepare(__file__)

from lcmchain.fmu.fmi3 import UnitSlave3 as Fmi3SlaveBase  # noqa: E402  # the name is looked for


class LcmchainUnit(Fmi3SlaveBase):
    """The unit; what it computes lies beside this file."""
