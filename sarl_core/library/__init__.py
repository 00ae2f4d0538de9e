"""What is kept: demonstrations, rule sets, results and notes, each with where it came from.

Names are loaded when they are first used: most of what works with a library needs no database to be
loaded. They stand in `__init__.pyi`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
