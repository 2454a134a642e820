"""The interface laws that a scene can choose in ``interfaces.laws``, by ``type``: a file each."""
