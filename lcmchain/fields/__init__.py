"""Fields of a forming result: what they are, how they follow from positions, and their files."""

import lazy_loader

# The names are those of the stub beside this file; each is imported when it is first asked for.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
