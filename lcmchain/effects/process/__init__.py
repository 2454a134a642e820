"""Effects of how the process goes: motion of the tools, its pace, and what lengthens the step.

``tool_motion`` moves the tools; ``pace`` finds how fast a process without a time may go;
``damping`` calms vibrations; ``mass_scaling`` and ``fibre_modulus`` make the time step longer.
"""
