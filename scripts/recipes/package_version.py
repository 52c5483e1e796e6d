"""Prints the version of an installed Python package: its name is the argument. Fails if it is not installed."""
import importlib.metadata
import importlib.util
import sys

name = sys.argv[1]
if importlib.util.find_spec(name) is None:
    sys.exit(f"the package {name} is not installed: pip install {name}")
print(name, importlib.metadata.version(name))
