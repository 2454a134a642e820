"""Coupling of forming and resin: permeability, filling, and the exchange between both.

::

    forming.nc ─▶ forming_fields ─▶ permeability ─▶ infiltration: a formed part fills with resin
    mould: a part is pressed while it fills = solids ◀── iteration ──▶ filling_part (infiltration)
    wet_forming: forming and resin at once  = solids ◀── iteration ──▶ filling_part (infiltration)
    cosimulation: FMI units as parts;  precice_adapter: parts as participants of preCICE

- ``permeability`` has the laws of aligned fibres, ``measured_permeability`` those of measured
  textiles. Both give ``principal_permeability``.
- ``iteration`` makes two parts agree in time windows. It depends on neither of them.
"""
