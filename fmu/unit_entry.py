"""Entry point of a forming unit; ``fmu/build.py`` copies this file into its resources.

pythonfmu runs it in the Python of the importing process, whose environment must have lcmchain.
"""

import ctypes
import os
import site
import sys
from importlib.util import find_spec
from pathlib import Path

# At every instantiation pythonfmu 0.7 gives back a reference to this module's names that it never
# took; without this one they would be gone at the second.
ctypes.pythonapi.Py_IncRef(ctypes.py_object(globals()))

# The private copy of pythonfmu in the unit vanishes with the unpacked unit: a process that goes on
# needs the installed one, so that the resources go to the end of the search path.
resources = os.path.dirname(__file__)
if resources in sys.path:
    sys.path.append(sys.path.pop(sys.path.index(resources)))

# A host that is no Python starts the interpreter outside of the environment it was started in.
if find_spec("lcmchain") is None:
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    for variable in ("VIRTUAL_ENV", "CONDA_PREFIX"):
        for library in (f"lib/{version}", "Lib"):
            folder = Path(os.environ.get(variable, ""), library, "site-packages")
            if os.environ.get(variable) and folder.is_dir():
                site.addsitedir(str(folder))

try:
    from lcmchain.fmu.forming_slave import FormingSlave
except ModuleNotFoundError as error:
    message = (
        f"this unit needs lcmchain in the Python {sys.version.split()[0]} of {sys.prefix} that "
        f"runs it (there is no module {error.name}): install it there, or start the importing "
        "program from the activated environment that has it"
    )
    print(message, file=sys.stderr)  # most masters show no log messages unless asked to
    raise ImportError(message) from error


class Forming(FormingSlave):
    """The unit; its scene lies beside this file."""
