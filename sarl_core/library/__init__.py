"""What is kept: demonstrations, rule sets, results and notes, each with where it came from."""

from sarl_core.library.items import Approval, Item, ItemFile
from sarl_core.library.library import Library, Quota, Usage

__all__ = ["Approval", "Item", "ItemFile", "Library", "Quota", "Usage"]
