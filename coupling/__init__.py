"""Exchange between forming and the fluid: permeability, and what couples them.

::

    forming.nc ─▶ forming_fields ─▶ permeability ─▶ infiltration: a formed part fills with resin
    closing: bag, tools, press ─▶ solids ◀──▶ iteration ◀──▶ filling_part (infiltration)
    wet_forming: forming and resin at once
    cosimulation: units of FMI as parts;  precice_adapter: parts as participants of preCICE

``iteration`` brings two parts to agree in time windows and knows none of them.
"""
