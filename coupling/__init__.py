"""Exchange between forming and the fluid: permeability and what couples them."""
