"""The program ``lumbre``: where it is, and how it is called."""

from __future__ import annotations

import importlib.metadata
import os
import shutil
import subprocess
import sysconfig
from pathlib import Path
from typing import Optional, Sequence, Union

#: Environment variable that names another program than the installed one.
VARIABLE = "LUMBRE"

#: Version of this package, which is that of the program in its wheel.
version: str
try:
    version = importlib.metadata.version("lumbre")
except importlib.metadata.PackageNotFoundError:
    version = "unknown"


class LumbreError(RuntimeError):
    """The program ended with an exit code that the caller did not expect.

    Attributes:
        code: Exit code; the command-line reference lists them.
        output: What the program printed to its standard error.
    """

    def __init__(self, message: str, code: int = -1, output: str = "") -> None:
        super().__init__(message)
        self.code = code
        self.output = output


def program() -> Path:
    """Returns the path of the program.

    It is the one that the environment variable ``LUMBRE`` names, else that of this package, else
    the one on ``PATH``.

    Raises:
        LumbreError: There is none.
    """
    named = os.environ.get(VARIABLE)
    if named:
        return Path(named)
    name = "lumbre.exe" if os.name == "nt" else "lumbre"
    for scheme in (None, f"{os.name}_user"):
        folder = sysconfig.get_path("scripts", scheme) if scheme else sysconfig.get_path("scripts")
        if folder and (Path(folder) / name).is_file():
            return Path(folder) / name
    found = shutil.which("lumbre")
    if found:
        return Path(found)
    raise LumbreError(f"the program `lumbre` was not found: install it, or name it with {VARIABLE}")


def call(
    arguments: Sequence[Union[str, Path]],
    *,
    codes: Sequence[int] = (0,),
    folder: Optional[Union[str, Path]] = None,
) -> str:
    """Runs the program with these arguments and returns its standard output.

    Args:
        arguments: Words of the command line, such as ``["metric", "a.exr", "b.exr"]``.
        codes: Exit codes that are no error.
        folder: Folder in which it runs; by default the current one.

    Raises:
        LumbreError: It ended with another exit code; the message contains its last lines.
    """
    words = [str(program()), *(str(word) for word in arguments)]
    ended = subprocess.run(
        words, cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False
    )
    if ended.returncode not in codes:
        last = "\n".join(ended.stderr.strip().splitlines()[-12:])
        message = f"lumbre {words[1]} ended with exit code {ended.returncode}:\n{last}"
        raise LumbreError(message, ended.returncode, ended.stderr)
    return ended.stdout
