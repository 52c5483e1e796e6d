"""Tests of the installed wheel. They run with ``python -m unittest`` in an environment that has it.

Environment: ``LUMBRE_ROOT`` is the root of the repository.
"""

import json
import os
import shutil
import struct
import subprocess
import tempfile
import unittest
import zlib
from pathlib import Path

import numpy as np

import lumbre
from lumbre.exr import read_metadata

ROOT = Path(os.environ["LUMBRE_ROOT"]).resolve()

SCRIPT = """
local x = experiment("small", { seed = 3, repeats = 2 })
x:axis("technique", { "nee", "bdpt" })
x:axis("samples", { 4 })
x:render(function(p)
  return { scene = "scenes/cornell.lua", integrator = p.technique, resolution = { 80, 70 }, max_depth = 3,
    films = { "albedo" }, denoise = p.technique == "bdpt" and "atrous" or "none" }
end)
x:reference { from = function() return { integrator = "nee" } end, stop = stop.samples(256) }
x:measure { every = "1s", rmse = metric.rmse(), keep = { exr = "pow2" } }
x:stop(function(p) return stop.samples(p.samples) end)
x:figure("convergence", { x = "samples", y = "rmse", by = "technique" })
x:table("rmse", { value = "rmse", rows = "technique" })
return x
"""


class Workplace(unittest.TestCase):
    """A folder with the scenes of the repository, in which one night is rendered."""

    @classmethod
    def setUpClass(cls):
        cls.before = os.getcwd()
        cls.place = tempfile.TemporaryDirectory()
        os.chdir(cls.place.name)
        for name in ("scenes", "scripts"):
            os.symlink(ROOT / name, name)
        Path("small.lua").write_text(SCRIPT)
        cls.night = lumbre.run("small.lua", samples=8)

    @classmethod
    def tearDownClass(cls):
        os.chdir(cls.before)
        cls.place.cleanup()


class NightTest(Workplace):
    def test_the_program_of_the_wheel_is_the_one_that_runs(self):
        self.assertTrue(lumbre.program().is_file())
        self.assertNotIn("target", lumbre.program().parts)
        self.assertEqual(lumbre.call(["--version"]).split()[1], lumbre.version)

    def test_a_night_has_its_runs_and_can_be_attached(self):
        night = lumbre.attach()
        self.assertEqual(night.folder, self.night.folder)
        self.assertEqual([run.point["technique"] for run in night.runs], ["nee", "nee", "bdpt", "bdpt"])
        self.assertTrue(all(run.is_done for run in night.runs))
        run = night.run(technique="bdpt", repeat=1)
        self.assertEqual((run.repeat, run.results["samples"]), (1, 8))
        for wrong, message in (
            ({"technique": "sppm"}, "values are technique: nee, bdpt"),
            ({"techniqe": "nee"}, "did you mean `technique`?"),
            ({"zebra": 1}, "there are technique, samples"),
            ({}, "2 runs have"),
        ):
            with self.assertRaises(KeyError) as caught:
                night.run(**wrong)
            self.assertIn(message, str(caught.exception))
        status = night.status()
        self.assertEqual((status["version"], status["state"], status["cells"]["done"]), (1, "finished", 4))

    def test_pictures_are_arrays_and_their_errors_are_those_of_the_night(self):
        for run in self.night.runs:
            picture, reference = run.picture, run.reference.picture
            self.assertEqual((picture.shape, picture.dtype), ((70, 80, 3), np.float32))
            error = np.sqrt(np.mean((picture.astype(float) - reference) ** 2))
            self.assertAlmostEqual(error, run.results["metrics"]["rmse"], places=9)
            self.assertEqual(run.metadata["samples"], "8")
        self.assertTrue((self.night.references[0].standard_error >= 0).all())

    def test_films_snapshots_error_maps_and_raw_pictures(self):
        plain, denoised = self.night.run(technique="nee"), self.night.run(technique="bdpt")
        self.assertEqual(plain.films, ["albedo"])
        albedo = plain.film("albedo")
        self.assertTrue((albedo >= 0).all() and albedo.max() <= 1 and albedo.max() > 0.4)
        self.assertEqual(albedo.shape, plain.picture.shape)
        # Earlier versions stored files.
        file = plain.folder / "films" / "bounces.exr"
        shutil.copy(plain.folder / "final.exr", file)
        self.assertEqual(plain.films, ["albedo", "bounces"])
        self.assertTrue((plain.film("bounces") == plain.picture).all())
        file.unlink()
        self.assertEqual(list(plain.snapshots), [1, 2, 4, 8])
        self.assertTrue((plain.raw == plain.picture).all())
        self.assertFalse((denoised.raw == denoised.picture).all())
        squares = plain.error_map("mse")
        self.assertAlmostEqual(float(squares.mean()) ** 0.5, plain.results["metrics"]["rmse"], places=6)

    def test_tables_are_lists_arrays_and_data_frames(self):
        summary = self.night.summary
        self.assertEqual(len(summary), 4)
        self.assertEqual(summary.column("rmse").dtype, np.float64)
        self.assertEqual(list(summary.column("technique"))[2:], ["bdpt", "bdpt"])
        self.assertEqual(len(summary.where(technique="nee")), 2)
        self.assertIn("<td>bdpt</td>", summary._repr_html_())
        means = self.night.tables["rmse"]
        self.assertEqual(means.rows[0]["technique"], "nee")
        curve = self.night.runs[0].measurements
        self.assertEqual(curve.column("samples")[-1], 8)
        try:
            import pandas
        except ImportError:
            self.skipTest("pandas is not installed")
        frame = summary.to_pandas()
        self.assertIsInstance(frame, pandas.DataFrame)
        self.assertEqual(frame.groupby("technique")["rmse"].count()["nee"], 2)
        kinds = {name: str(frame[name].dtype) for name in ("cell", "repeat", "samples", "rmse")}
        expected = {"cell": "int64", "repeat": "int64", "samples": "int64", "rmse": "float64"}
        self.assertEqual(kinds, expected)

    def test_columns_of_whole_numbers_are_integers(self):
        Path("a.csv").write_text(f"a,b,c,d,e\n1,,2.5,{2**64},x\n-2,7,3,1,\n")
        table = lumbre.Table.read("a.csv")
        self.assertEqual(table.rows[1], {"a": -2, "b": 7, "c": 3.0, "d": 1.0, "e": None})
        self.assertIsInstance(table.rows[0]["a"], int)
        self.assertEqual(table.column("b").dtype, np.float64)
        try:
            import pandas  # noqa: F401
        except ImportError:
            self.skipTest("pandas is not installed")
        kinds = [str(kind) for kind in table.to_pandas().dtypes]
        self.assertEqual(kinds[:4], ["int64", "Int64", "float64", "float64"])

    def test_figures_show_in_a_notebook(self):
        figure = self.night.figures["convergence"]
        self.assertIn("<svg", figure._repr_svg_())
        self.assertIn("mean", figure.points.columns)

    def test_time_axes_are_arrays(self):
        text = SCRIPT.replace("films = {", "film = { time = { bin = 0.5, bins = 12 } }, films = {")
        Path("timed.lua").write_text(text.replace("small", "timed"))
        night = lumbre.run("timed.lua", out="timed")
        cube = night.run(technique="nee").cube
        self.assertIn(12, cube.shape)
        self.assertGreater(cube.sum(), 0)
        with self.assertRaises(FileNotFoundError):
            self.night.runs[0].cube

    def test_errors_tell_what_the_program_said(self):
        Path("wrong.lua").write_text("return experiment(")
        with self.assertRaises(lumbre.LumbreError) as caught:
            lumbre.run("wrong.lua")
        self.assertEqual(caught.exception.code, 2)
        self.assertIn("wrong.lua", str(caught.exception))
        with self.assertRaises(FileNotFoundError):
            lumbre.attach("scenes")

    def test_finished_runs_are_not_rendered_again(self):
        again = lumbre.run("small.lua", samples=8)
        self.assertEqual(again.folder, self.night.folder)
        longer = lumbre.run("small.lua", samples=[8, 16], only={"technique": "nee"})
        self.assertEqual({run.results["samples"] for run in longer.runs if run.is_done}, {8, 16})


class ExrTest(unittest.TestCase):
    def test_damaged_and_foreign_files_are_errors(self):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "a.exr"
            for content in (b"", b"\x76\x2f\x31\x01", b"PNG", b"\x76\x2f\x31\x01\x02\0\0\0\0" * 9):
                path.write_bytes(content)
                with self.assertRaises(ValueError):
                    lumbre.read_exr(path)

    def test_a_file_written_by_hand_is_read(self):
        def attribute(name, kind, value):
            return name + b"\0" + kind + b"\0" + struct.pack("<i", len(value)) + value

        names = (b"B", b"G", b"R")
        channels = b"".join(n + b"\0" + struct.pack("<iiii", 2, 0, 1, 1) for n in names) + b"\0"
        box = struct.pack("<iiii", 0, 0, 2, 17)
        header = struct.pack("<II", 20000630, 2)
        header += attribute(b"channels", b"chlist", channels)
        header += attribute(b"compression", b"compression", b"\x03")
        header += attribute(b"dataWindow", b"box2i", box)
        header += attribute(b"lumbre.run", b"string", b"abc") + b"\0"
        wanted = np.arange(18 * 3 * 3, dtype=np.float32).reshape(18, 3, 3) / 7
        body, offsets, start = b"", [], len(header) + 16
        for first in (0, 16):
            rows = wanted[first : first + 16]
            raw = rows[:, :, ::-1].transpose(0, 2, 1).astype("<f4").tobytes()
            split = np.frombuffer(raw[0::2] + raw[1::2], np.uint8).astype(int)
            coded = split.copy()
            coded[1:] = (np.diff(split) + 128) & 0xFF
            packed = zlib.compress(coded.astype(np.uint8).tobytes())
            block = packed if len(packed) < len(raw) else raw
            offsets.append(start + len(body))
            body += struct.pack("<ii", first, len(block)) + block
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "a.exr"
            path.write_bytes(header + struct.pack("<2Q", *offsets) + body)
            self.assertTrue((lumbre.read_exr(path) == wanted).all())
            self.assertEqual(read_metadata(path), {"run": "abc"})


class NotebookTest(Workplace):
    def test_the_notebook_of_the_documentation_runs(self):
        notebook = json.loads((ROOT / "docs/notebooks/two_nights.ipynb").read_text())
        names: dict = {}
        for cell in notebook["cells"]:
            if cell["cell_type"] == "code":
                source = "".join(cell["source"])
                exec(compile(source, "two_nights.ipynb", "exec"), names)
        self.assertTrue(Path("two_nights.png").is_file())


class TypesTest(unittest.TestCase):
    def test_the_module_is_typed(self):
        self.assertTrue((Path(lumbre.__file__).parent / "py.typed").is_file())
        try:
            import mypy  # noqa: F401
        except ImportError:
            self.skipTest("mypy is not installed")
        words = ["python", "-m", "mypy", "--strict", "--ignore-missing-imports", "-p", "lumbre"]
        import sys

        ended = subprocess.run([sys.executable, *words[1:]], capture_output=True, text=True)
        self.assertEqual(ended.returncode, 0, ended.stdout)


if __name__ == "__main__":
    unittest.main()
