"""Hard cases of the element, the time integration, contact and forming, with their criteria."""
