# The public names, each with its home: what is loaded when, and what type checkers see.
from .items import Item as Item
from .items import ItemFile as ItemFile
from .library import Library as Library
from .library import Quota as Quota
from .library import Usage as Usage
