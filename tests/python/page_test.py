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
            self.assertEqual(len(blocks), 9)
            for block in blocks:
                exec(compile(block, "docs/python.md", "exec"), names)
        finally:
            os.chdir(before)
        self.assertEqual(names["image"].shape, (names["camera"].height, names["camera"].width, 3))
        self.assertLess(names["losses"][-1], names["losses"][0])
        self.assertEqual(names["vertices"].shape[1], 3)
        self.assertTrue(np.all(np.isfinite(names["picture"])))


if __name__ == "__main__":
    unittest.main()
