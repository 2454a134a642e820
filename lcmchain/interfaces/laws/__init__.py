"""The interface laws that a scene can choose as ``interfaces.laws.type``: a file each."""
