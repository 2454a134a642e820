"""A part that is pressed together while resin flows: bag, closing tools, press."""
