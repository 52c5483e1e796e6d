"""Nights: their runs, references, tables and figures, read from their folders."""

from __future__ import annotations

import difflib
import json
import tempfile
from pathlib import Path
from typing import Any, Dict, Iterable, List, Optional, Sequence, Union

import numpy as np

from ._program import LumbreError, call
from .exr import read_exr, read_metadata
from .table import Table

#: Exit codes of a night that has results: done, some runs failed, stopped, bias alarm.
_NIGHT_CODES = (0, 3, 4, 6)


class Figure:
    """A figure, which a notebook shows.

    Attributes:
        path: The SVG file.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def __repr__(self) -> str:
        return f"<Figure {self.path.stem}>"

    @property
    def svg(self) -> str:
        """Text of the SVG file."""
        return self.path.read_text(encoding="utf-8")

    @property
    def points(self) -> Table:
        """What is drawn: axis values, ``metric``, ``x``, ``mean``, ``low``, ``high``, ``runs``."""
        return Table.read(self.path.with_suffix(".csv"))

    def _repr_svg_(self) -> str:
        return self.svg


class _Rendered:
    """Folder of something that was rendered."""

    _PICTURE = ""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    @property
    def picture(self) -> "np.ndarray":
        """The picture in linear radiance, ``[row, column, rgb]``."""
        return read_exr(self.folder / self._PICTURE)

    @property
    def metadata(self) -> Dict[str, str]:
        """Facts in the header of the picture: run, samples, seed, device, program."""
        return read_metadata(self.folder / self._PICTURE)

    @property
    def config(self) -> Dict[str, Any]:
        """Settings with which it was rendered: ``config.json``."""
        return _json(self.folder / "config.json")


class Reference(_Rendered):
    """A picture that runs are measured against."""

    _PICTURE = "ref.exr"

    def __repr__(self) -> str:
        return f"<Reference {self.folder.name[:8]}>"

    @property
    def standard_error(self) -> "np.ndarray":
        """Standard error of each pixel, ``[row, column, rgb]``."""
        return read_exr(self.folder / "noise.exr")


class Run(_Rendered):
    """One run of a night.

    Attributes:
        id: Run id.
        path: Readable path, such as ``technique=nee/rep=0``.
        point: Axis values.
        repeat: Number of the repeat, from 0.
        folder: Folder of its files, which exists if it was started.
        reference: The reference that it is measured against, if any.
    """

    _PICTURE = "final.exr"

    def __init__(self, planned: Dict[str, Any], folder: Path, reference: Optional[Reference]):
        super().__init__(folder)
        self.id: str = planned["run"]
        self.path: str = planned["path"]
        self.point: Dict[str, Any] = planned["point"]
        self.repeat: int = planned["repeat"]
        self.reference = reference

    def __repr__(self) -> str:
        return f"<Run {self.path}>"

    @property
    def is_done(self) -> bool:
        """Whether it is finished."""
        return (self.folder / "done.json").is_file()

    @property
    def results(self) -> Dict[str, Any]:
        """How it ended: ``done.json``."""
        return _json(self.folder / "done.json")

    @property
    def measurements(self) -> Table:
        """One row for each measurement: samples, times and metrics."""
        return Table.read(self.folder / "metrics.csv")

    @property
    def raw(self) -> "np.ndarray":
        """The mean of its samples; the same as the picture unless that is denoised."""
        raw = self.folder / "raw.exr"
        return read_exr(raw) if raw.is_file() else self.picture

    @property
    def snapshots(self) -> Dict[int, Path]:
        """EXR files of pictures during the run, by samples per pixel."""
        files = self.folder.glob("snap-*.exr")
        return dict(sorted((int(file.stem.split("-")[1]), file) for file in files))

    @property
    def films(self) -> List[str]:
        """Names of the films that are stored beside the picture or as layers of its file."""
        files = [file.stem for file in (self.folder / "films").glob("*.exr")]
        return sorted({*files, *self._layers()})

    def film(self, name: str) -> "np.ndarray":
        """Returns a film, such as ``albedo``, as ``[row, column, channel]``."""
        layers = self._layers()
        if name in layers:
            return read_exr(self.folder / self._PICTURE, layers[name])
        return read_exr(self.folder / "films" / f"{name}.exr")

    def _layers(self) -> Dict[str, List[str]]:
        """Channels of the layers in the file of the picture, by the name of the film."""
        if not (self.folder / self._PICTURE).is_file():
            return {}
        layers = {}
        for key, channels in self.metadata.items():
            if key.startswith("film."):
                names = [channel.split(" = ")[0] for channel in channels.split(", ")]
                layers[key[len("film."):]] = names
        return layers

    @property
    def cube(self) -> "np.ndarray":
        """Radiance by time: the array of a run with a time axis, without copying it to memory."""
        cubes = sorted((self.folder / "films").glob("*.npy"))
        if not cubes:
            raise FileNotFoundError(f"{self.path} has no time axis")
        cube: np.ndarray = np.load(cubes[0], mmap_mode="r")
        return cube

    def error_map(self, metric: str = "relmse") -> "np.ndarray":
        """Returns the error of every pixel against the reference, ``[row, column]``.

        Raises:
            LumbreError: There is no reference, or the metric has no error of a pixel.
        """
        if self.reference is None:
            raise LumbreError(f"{self.path} has no reference")
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "map.exr"
            pictures = [self.folder / self._PICTURE, self.reference.folder / "ref.exr"]
            call(["diff", *pictures, "--metric", metric, "--out", out])
            return read_exr(out)[:, :, 0]


class Night:
    """A night: the folder of an experiment, finished or not. What is read is read again each time,
    so a night that runs elsewhere can be followed.

    Attributes:
        folder: The folder.
    """

    def __init__(self, folder: Union[str, Path]) -> None:
        self.folder = Path(folder).resolve()
        if not (self.folder / "plan.json").is_file():
            raise FileNotFoundError(f"{folder} is not the folder of a night: it has no plan.json")

    def __repr__(self) -> str:
        return f"<Night {self.name}: {len(self.plan['cells'])} runs in {self.folder}>"

    @property
    def plan(self) -> Dict[str, Any]:
        """The plan: ``plan.json``."""
        return _json(self.folder / "plan.json")

    @property
    def name(self) -> str:
        """Name of the experiment."""
        return str(self.plan["name"])

    @property
    def references(self) -> List[Reference]:
        """References in the order of the plan."""
        return [Reference(self._reference(planned)) for planned in self.plan["references"]]

    @property
    def runs(self) -> List[Run]:
        """Runs in the order of the plan, finished or not."""
        references = self.references
        runs = []
        elsewhere: Optional[Dict[str, Path]] = None
        for planned in self.plan["cells"]:
            index = planned.get("reference")
            reference = None if index is None else references[index]
            folder = self.folder / "runs" / planned["folder"]
            if not (folder / "done.json").is_file():
                if elsewhere is None:
                    elsewhere = self._finished_elsewhere()
                folder = elsewhere.get(planned["run"], folder)
            runs.append(Run(planned, folder, reference))
        return runs

    def run(self, repeat: int = 0, **point: Any) -> Run:
        """Returns the run with these axis values.

        Raises:
            KeyError: There is no such axis, there is no such run, or there are several.
        """
        runs = self.runs
        axes = {axis: _distinct(run.point.get(axis) for run in runs) for run in runs for axis in run.point}
        for axis in point:
            if axis not in axes:
                near = difflib.get_close_matches(axis, axes, 1)
                known = f"did you mean `{near[0]}`?" if near else f"there are {', '.join(axes)}"
                raise KeyError(f"there is no axis `{axis}`: {known}")

        def matches(run: Run) -> bool:
            wanted = all(run.point.get(axis) == value for axis, value in point.items())
            return wanted and run.repeat == repeat

        found = [run for run in runs if matches(run)]
        if len(found) != 1:
            values = "; ".join(f"{axis}: {', '.join(map(str, axes[axis]))}" for axis in axes)
            raise KeyError(f"{len(found)} runs have {point} and repeat {repeat}; values are {values}")
        return found[0]

    @property
    def summary(self) -> Table:
        """One row for each run: axis values, state, samples, times and last values."""
        return Table.read(self.folder / "summary.csv")

    @property
    def tables(self) -> Dict[str, Table]:
        """Tables of the script that are written as CSV, by name."""
        return {file.stem: Table.read(file) for file in sorted((self.folder / "tables").glob("*.csv"))}

    @property
    def figures(self) -> Dict[str, Figure]:
        """Figures of the script, by the names of their files."""
        files = sorted((self.folder / "figures").glob("*.svg"))
        return {file.stem: Figure(file) for file in files}

    def status(self) -> Dict[str, Any]:
        """Returns the progress of the night, as ``lumbre status --json`` describes it."""
        status: Dict[str, Any] = json.loads(call(["status", self.folder, "--json"], codes=(0, 3)))
        return status

    def report(self) -> Path:
        """Writes a report and returns its page."""
        call(["report", self.folder, "-q"])
        return self.folder / "report" / "index.html"

    def _finished_elsewhere(self) -> Dict[str, Path]:
        """Folders of runs that earlier nights of the same name have finished, by run id."""
        done = self.folder.parent.glob(f"{self.name}-*/runs/**/done.json")
        return {file.parent.name: file.parent for file in done if self.folder not in file.parents}

    def _reference(self, planned: Dict[str, Any]) -> Path:
        run: str = planned["run"]
        return self.folder.parent / "refs" / run[:2] / run


def run(
    script: Union[str, Path],
    *,
    out: Union[str, Path] = "out",
    only: Optional[Dict[str, Any]] = None,
    allow_commands: bool = False,
    arguments: Sequence[str] = (),
    **axes: Any,
) -> Night:
    """Renders an experiment and returns its night. What is finished is not rendered again.

    Args:
        script: Lua file.
        out: Folder of results.
        only: Axis values to which the sweep is restricted.
        allow_commands: Whether commands of the script may run.
        arguments: Further words of the command line, such as ``["--until", "08:00"]``.
        axes: Values that replace those of axes; a list for several.

    Raises:
        LumbreError: The script is wrong, or nothing could be rendered. Single runs that fail are no
            error: their state is in the summary.
    """
    words: List[str] = ["run", str(script)]
    words += [f"{axis}={_text(values)}" for axis, values in axes.items()]
    words += ["--out", str(out), "-q", "--no-tui"]
    for axis, values in (only or {}).items():
        words += ["--only", f"{axis}={_text(values)}"]
    if allow_commands:
        words.append("--allow-commands")
    call([*words, *arguments], codes=_NIGHT_CODES)
    return attach(Path(out) / "latest")


def attach(folder: Union[str, Path] = "out/latest") -> Night:
    """Opens the folder of a night that is finished, or that another process renders.

    Raises:
        FileNotFoundError: It is not the folder of a night.
    """
    return Night(folder)


def _text(values: Any) -> str:
    """Writes values as on the command line."""
    if isinstance(values, bool):
        return "true" if values else "false"
    if isinstance(values, (list, tuple)):
        return ",".join(_text(value) for value in values)
    return str(values)


def _distinct(values: Iterable[Any]) -> List[Any]:
    """Returns values without repetitions, in their order; they need not be hashable."""
    found: List[Any] = []
    for value in values:
        if value not in found:
            found.append(value)
    return found


def _json(path: Path) -> Dict[str, Any]:
    content: Dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return content
