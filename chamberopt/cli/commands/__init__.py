"""Define the commands, in a file each. Importing this package registers all of them with `app`."""

from importlib import import_module
from pkgutil import walk_packages

for _module in walk_packages(__path__, f"{__name__}."):
    import_module(_module.name)
