"""Readable safety rules from expert demonstrations, and a shield that holds an agent to them.

Names are loaded when they are first used, so that importing the package costs next to nothing
and a program that only mines rules never loads a learner. They stand in `__init__.pyi`.
"""

import lazy_loader

__version__ = "0.2.0"
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
