"""Effects that laws and elements compute; here is told whether a model has them, and why.

The physics stands where the kernels are: laws and their features (:mod:`lcmchain.materials`), the
elements (:mod:`lcmchain.elements`). Each file says what its effect adds, whether the scene calls
for it, and how ``[effects]`` takes it out.
"""
