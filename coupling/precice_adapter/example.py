"""A coupling to start from: a consolidating column, its solid and its fluid as participants."""

from __future__ import annotations

from pathlib import Path

from lcmchain.atomic import replacing
from lcmchain.errors import InputError

#: Window and end of the example, as times of consolidation T = c_v t / H²: 0.05 and 0.85.
WINDOW, END = 0.5, 8.5

CONFIGURATION = f"""\
<?xml version="1.0" encoding="UTF-8"?>
<!-- A consolidating column: its solid and its fluid, brought to agree in every window.
     solid.toml and fluid.toml say what each participant simulates. -->
<precice-configuration>
  <log>
    <sink filter="%Severity% > info" enabled="true"/>
  </log>

  <!-- rates of the cells' volumes are held over a window, pressures are linear in it -->
  <data:scalar name="Volume-Rate" waveform-degree="0"/>
  <data:scalar name="Volume-Rate-Slope" waveform-degree="0"/>
  <data:scalar name="Reference-Pressure" waveform-degree="0"/>
  <data:scalar name="Pore-Pressure" waveform-degree="1"/>

  <mesh name="Solid-Mesh" dimensions="3">
    <use-data name="Volume-Rate"/>
    <use-data name="Volume-Rate-Slope"/>
    <use-data name="Reference-Pressure"/>
    <use-data name="Pore-Pressure"/>
  </mesh>
  <mesh name="Fluid-Mesh" dimensions="3">
    <use-data name="Volume-Rate"/>
    <use-data name="Volume-Rate-Slope"/>
    <use-data name="Reference-Pressure"/>
    <use-data name="Pore-Pressure"/>
  </mesh>

  <participant name="Solid">
    <provide-mesh name="Solid-Mesh"/>
    <write-data name="Volume-Rate" mesh="Solid-Mesh"/>
    <write-data name="Volume-Rate-Slope" mesh="Solid-Mesh"/>
    <write-data name="Reference-Pressure" mesh="Solid-Mesh"/>
    <read-data name="Pore-Pressure" mesh="Solid-Mesh"/>
  </participant>

  <participant name="Fluid">
    <provide-mesh name="Fluid-Mesh"/>
    <receive-mesh name="Solid-Mesh" from="Solid"/>
    <read-data name="Volume-Rate" mesh="Fluid-Mesh"/>
    <read-data name="Volume-Rate-Slope" mesh="Fluid-Mesh"/>
    <read-data name="Reference-Pressure" mesh="Fluid-Mesh"/>
    <write-data name="Pore-Pressure" mesh="Fluid-Mesh"/>
    <!-- Both have the same cells. On other cells: rates and slopes are volumes, so conservative,
         pressures consistent. -->
    <mapping:nearest-neighbor direction="read" from="Solid-Mesh" to="Fluid-Mesh"
                              constraint="consistent"/>
    <mapping:nearest-neighbor direction="write" from="Fluid-Mesh" to="Solid-Mesh"
                              constraint="conservative"/>
  </participant>

  <m2n:sockets acceptor="Solid" connector="Fluid" exchange-directory="."/>

  <coupling-scheme:serial-implicit>
    <participants first="Solid" second="Fluid"/>
    <max-time value="{END}"/>
    <time-window-size value="{WINDOW}"/>
    <max-iterations value="50"/>
    <exchange data="Volume-Rate" mesh="Solid-Mesh" from="Solid" to="Fluid" substeps="false"/>
    <exchange data="Volume-Rate-Slope" mesh="Solid-Mesh" from="Solid" to="Fluid" substeps="false"/>
    <exchange data="Reference-Pressure" mesh="Solid-Mesh" from="Solid" to="Fluid" substeps="false"/>
    <exchange data="Pore-Pressure" mesh="Solid-Mesh" from="Fluid" to="Solid" initialize="true"
              substeps="false"/>
    <relative-convergence-measure data="Pore-Pressure" mesh="Solid-Mesh" limit="1e-11"/>
    <acceleration:IQN-ILS>
      <data name="Pore-Pressure" mesh="Solid-Mesh"/>
      <initial-relaxation value="1.0"/>
      <max-used-iterations value="40"/>
      <time-windows-reused value="0"/>
      <filter type="QR2" limit="1e-3"/>
    </acceleration:IQN-ILS>
  </coupling-scheme:serial-implicit>
</precice-configuration>
"""

SOLID = """\
# The solid of a consolidating column: lcmchain precice solid.toml
participant = "Solid"
config = "precice-config.xml"
mesh = "Solid-Mesh"

[part]
type = "column"
side = "solid"

[[read]]
data = "Pore-Pressure"
field = "pore_pressure"

[[write]]
data = "Volume-Rate"
field = "volume_rate"
of_window = "mean"          # conserves the volume, however many sub-steps there are

# The fixed-stress split: how the rate answers to the pressure, and at which one it was found.
[[write]]
data = "Volume-Rate-Slope"
field = "volume_rate_slope"

[[write]]
data = "Reference-Pressure"
field = "reference_pressure"
"""

FLUID = """\
# The fluid of a consolidating column: lcmchain precice fluid.toml
participant = "Fluid"
config = "precice-config.xml"
mesh = "Fluid-Mesh"

[part]
type = "column"
side = "fluid"

[[read]]
data = "Volume-Rate"
field = "volume_rate"
within = "held"

[[read]]
data = "Volume-Rate-Slope"
field = "volume_rate_slope"
within = "held"

[[read]]
data = "Reference-Pressure"
field = "reference_pressure"
within = "held"

[[write]]
data = "Pore-Pressure"
field = "pore_pressure"
"""

FILES = {"precice-config.xml": CONFIGURATION, "solid.toml": SOLID, "fluid.toml": FLUID}


def write_example(folder: Path) -> list[Path]:
    """Write the configuration and the files of both participants into a folder.

    Raises
    ------
    InputError : one of the files is there already, perhaps changed since.
    """
    for name in FILES:
        if (folder / name).exists():
            raise InputError("exists already; name another folder", file=folder / name)
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in FILES.items():
        with replacing(folder / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return [folder / name for name in FILES]
