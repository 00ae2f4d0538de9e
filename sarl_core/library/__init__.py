"""What is kept: demonstrations, rule sets, results and notes, each with where it came from."""

from sarl_core.explaining.words.sign_off import Approval
from sarl_core.library.items import Item, ItemFile
from sarl_core.library.library import Library, Quota, Usage

__all__ = ["Approval", "Item", "ItemFile", "Library", "Quota", "Usage"]
