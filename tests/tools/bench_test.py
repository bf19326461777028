"""The gate of tools/bench: a program that stands in for hsi4d "measures" what bench/front.json holds, and fronts that are
doctored make it fail.

    bench_test.py FOLDER_OF_TOOLS
"""

import copy
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

TOOLS = pathlib.Path(sys.argv.pop(1)).resolve()
ISA, STORED = next(iter(json.loads((TOOLS.parent / "bench/front.json").read_text())["fronts"].items()))
PRESETS = ("default", "reference", "accurate")

STAND_IN = """#!/usr/bin/env python3
import pathlib, shutil, sys
shutil.copy(pathlib.Path(__file__).with_name("rows.json"), sys.argv[sys.argv.index("--json") + 1])
"""


def row(scene, knob, value, time_ratio, errors, decibels=60.0):
    return {"scene": scene, "knob": knob, "value": value, "model": "own", "isa": ISA, "time_ratio": time_ratio,
            "psnr_db": decibels, "image_rms": errors["image_rms"], "image_max": errors["image_max"],
            "gradients": {"means": {"relative_l2": errors["gradient"]}, "sh": {"relative_l2": 0.0}}}


def measured_rows():
    """Rows from which the stored front follows."""
    exact = {"image_rms": 2e-7, "image_max": 2e-6, "gradient": 6e-7}
    near = {"image_rms": 4e-6, "image_max": 3e-5, "gradient": 6e-4}
    rows = []
    for scene, errors in STORED["default"]["errors"].items():
        rows.append(row(scene, "quality", "default", 1.0, errors))
        rows.append(row(scene, "quality", "reference", 1 / STORED["default"]["time"], exact, 130.0))
        rows.append(row(scene, "quality", "accurate", 2.2, near, 108.0))
        for point in STORED["front"]:
            if point["knob"] != "quality" or point["value"] not in PRESETS:
                rows.append(row(scene, point["knob"], point["value"], point["time_ratio"], point))
    return rows


class Gate(unittest.TestCase):
    front_text = None  # what the tool stores of the rows

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.program = pathlib.Path(folder.name) / "hsi4d"
        self.program.write_text(STAND_IN)
        self.program.chmod(0o755)
        self.front = pathlib.Path(folder.name) / "front.json"
        self.measure(measured_rows())
        if Gate.front_text is None:
            self.assertEqual(self.run_gate("--store").returncode, 0)
            Gate.front_text = self.front.read_text()
        self.front.write_text(Gate.front_text)
        self.stored = json.loads(Gate.front_text)["fronts"][ISA]
        self.product = next(i for i, point in enumerate(self.stored["front"]) if point["knob"] == "product")

    def measure(self, rows):
        self.program.with_name("rows.json").write_text("".join(json.dumps(one) + "\n" for one in rows))

    def write_fronts(self, fronts):
        self.front.write_text(json.dumps({"fronts": fronts}))

    def run_gate(self, *more):
        command = [sys.executable, TOOLS / "bench", "--program", self.program, "--front", self.front, *more]
        return subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def check_bound(self, bound, worsen):
        """`worsen(front, by)` makes what is measured look `by` times as bad: just below the bound the gate holds, just
        above it does not. Returns what it says then."""
        for by, status in ((1 + 0.99 * (bound - 1), 0), (1 + 1.02 * (bound - 1), 1)):
            doctored = copy.deepcopy(self.stored)
            worsen(doctored, by)
            self.write_fronts({ISA: doctored})
            result = self.run_gate()
            self.assertEqual(result.returncode, status, f"{by}\n{result.stdout}\n{result.stderr}")
        self.assertIn(f"worse than {self.front} allows:\n", result.stderr)
        return result.stderr

    def test_what_was_stored_holds(self):
        self.assertEqual(self.stored["default"]["errors"], STORED["default"]["errors"])
        self.assertAlmostEqual(self.stored["default"]["time"], STORED["default"]["time"])
        result = self.run_gate()
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("quality default: 1.000 of the stored time (at most 1.10)", result.stdout)

    def test_the_default_is_too_slow(self):
        def worsen(stored, by):
            stored["default"]["time"] /= by
        self.assertIn("  quality default: 1.102 of the stored time", self.check_bound(1.10, worsen))

    def test_every_instruction_set_has_a_front_of_its_own(self):
        slow = copy.deepcopy(self.stored)
        slow["default"]["time"] /= 2
        self.write_fronts({"another": slow})
        done = self.run_gate()
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn(f"told, not compared: stored ones are of another, these of {ISA}", done.stdout)
        slow["default"]["errors"]["needles"]["gradient"] /= 2
        self.write_fronts({"another": slow})
        self.assertEqual(self.run_gate().returncode, 1)  # errors are the same on all
        self.write_fronts({"another": slow, ISA: self.stored})
        self.assertEqual(self.run_gate().returncode, 0)
        self.assertEqual(self.run_gate("--store").returncode, 0)
        self.assertEqual(json.loads(self.front.read_text())["fronts"], {"another": slow, ISA: self.stored})

    def test_a_setting_of_the_front_is_too_slow(self):
        def worsen(stored, by):
            stored["front"][self.product]["time_ratio"] /= by
        name = f"product {self.stored['front'][self.product]['value']}"
        self.assertIn(f"  {name}: 1.102 of the stored time", self.check_bound(1.10, worsen))

    def test_an_error_of_the_default_is_too_large(self):
        for error in ("image_rms", "image_max", "gradient"):
            def worsen(stored, by, error=error):
                stored["default"]["errors"]["needles"][error] /= by
            said = self.check_bound(1.05, worsen)
            self.assertIn("  quality default, needles: ", said)
            self.assertIn(f"{error} 1.051", said)

    def test_an_error_of_the_front_is_too_large(self):
        def worsen(stored, by):
            stored["front"][self.product]["gradient"] /= by
        name = f"product {self.stored['front'][self.product]['value']}"
        self.assertIn(f"  {name}, median: ", self.check_bound(1.05, worsen))

    def test_accurate_does_not_keep_its_promise(self):
        def too_few_decibels(one):
            one["psnr_db"] = 99.9
        def no_decibels(one):
            one["psnr_db"] = float("nan")
        def too_far(one):
            one["gradients"]["sh"]["relative_l2"] = 1.1e-3
        for spoil in (too_few_decibels, no_decibels, too_far):
            rows = measured_rows()
            spoil(next(one for one in rows if one["value"] == "accurate" and one["scene"] == "dense"))
            self.measure(rows)
            result = self.run_gate()
            self.assertEqual(result.returncode, 1)
            self.assertIn("\n  quality accurate, dense: ", result.stderr)
            self.assertEqual(self.run_gate("--store").returncode, 1)
            self.assertEqual(self.front.read_text(), Gate.front_text)  # nothing was written

    def check_nothing_to_compare(self, words):
        result = self.run_gate()
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
        self.assertIn(words, result.stderr)

    def test_there_is_no_front_or_none_that_can_be_read(self):
        self.front.unlink()
        self.check_nothing_to_compare("front.json: No such file or directory; tools/bench --store writes it")
        for text, problem in (("{", "is no JSON"), ("[]", "/fronts: is no object"), ('{"fronts": {}}', "/fronts: is no object")):
            self.front.write_text(text)
            self.check_nothing_to_compare(f"front.json: {problem}")
        stored = self.stored
        for one, problem in (
            ([], "/front: is no list of settings"),
            (dict(stored, default=1), "/default: is no object"),
            (dict(stored, default={"time": True}), "/default/time: is no number"),
            (dict(stored, default={"time": 1, "errors": {}}), "/default/errors/sparse: is no object"),
            (dict(stored, front=[{"knob": "tile"}]), "/front/0/time_ratio: is no number"),
            (dict(stored, front=[dict(stored["front"][0], value=8)]), "/front/0: names no setting"),
        ):
            self.write_fronts({ISA: one})
            self.check_nothing_to_compare(f"front.json: /fronts/{ISA}{problem}")

    def test_a_setting_is_no_more(self):
        self.stored["front"][self.product]["value"] = "alpha_min 1/3"
        self.write_fronts({ISA: self.stored})
        self.check_nothing_to_compare("has no setting product alpha_min 1/3; tools/bench --store")

    def test_there_is_no_program(self):
        self.program.unlink()
        self.check_nothing_to_compare(f"there is no {self.program}; tools/test builds it")


unittest.main()
