"""Does what docs/python.md says: its command, with a smaller clip, then every block of Python to the letter in one go."""

import os
import re
import shutil
import unittest

import numpy as np

from support import SOURCE, program, scratch


class Page(unittest.TestCase):
    def test_the_page(self):
        text = (SOURCE / "docs/python.md").read_text()
        folder = scratch()
        shutil.copytree(SOURCE / "configs", folder / "configs")
        before = os.getcwd()
        os.chdir(folder)
        try:
            commands = re.findall(r"^    hsi4d (.+)$", text, re.MULTILINE)
            self.assertEqual(len(commands), 1)
            program(*commands[0].split(), "--set", "synthetic.size_px=96", "--set", "synthetic.frames=4")
            names = {}
            blocks = re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
            self.assertEqual(len(blocks), 10)
            for block in blocks:
                exec(compile(block, "docs/python.md", "exec"), names)
        finally:
            os.chdir(before)
        self.assertEqual(names["image"].shape, (names["camera"].height, names["camera"].width, 3))
        self.assertLess(names["losses"][-1], names["losses"][0])
        self.assertEqual(names["vertices"].shape[1], 3)
        self.assertTrue(np.all(np.isfinite(names["picture"])))
        self.check_autograd(names)

    def check_autograd(self, names):
        """The page's automatic differentiation: its term has a gradient of its own, and a wrong rule in it is found."""
        stage, variable = names["camera_stage"], names["Variable"]
        stage.evaluate()
        self.assertGreater(stage.terms["charbonnier"], 0)
        self.assertEqual(stage.weights["charbonnier"], 1)
        image = np.array([0.5, -2, 3])
        value, adjoints = names["charbonnier"](image, np.zeros(3))
        self.assertAlmostEqual(value, np.sqrt(image**2 + 1e-4).mean())
        np.testing.assert_allclose(adjoints["rendered"], image / np.sqrt(image**2 + 1e-4) / 3)
        variable.mean = lambda self: variable(self.value.mean(), (self, lambda d: np.full_like(self.value, d)))
        self.assertFalse(stage.check_gradients()["ok"])


if __name__ == "__main__":
    unittest.main()
