"""Runs Lumbre and reads the results of its nights.

A night is a scheduled run of an experiment, which a Lua script describes. :func:`run` renders one
and :func:`attach` opens the folder of one, finished or not; both return a :class:`Night`.
"""

from ._program import LumbreError, call, program, version
from .exr import read_exr
from .night import Figure, Night, Reference, Run, attach, run
from .table import Table

__all__ = [
    "Figure",
    "LumbreError",
    "Night",
    "Reference",
    "Run",
    "Table",
    "attach",
    "call",
    "program",
    "read_exr",
    "run",
    "version",
]

__version__ = version
