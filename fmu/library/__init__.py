"""The guard between a master and the exporter's library in a unit: sources, objects, linking."""
