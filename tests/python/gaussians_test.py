"""Gaussians: views of their memory, and their files."""

import gc
import sys
import unittest

import numpy as np

import hsi4d
from support import random_gaussians, scratch

NAMES = {"means": 3, "quats": 4, "log_scales": 3}


class Views(unittest.TestCase):
    def test_arrays_are_views_of_the_same_memory(self):
        gaussians = random_gaussians(5)
        for name in ["means", "quats", "log_scales", "opacity_logits", "sh"]:
            first, second = getattr(gaussians, name), getattr(gaussians, name)
            self.assertEqual(first.dtype, np.float32)
            self.assertTrue(np.shares_memory(first, second))
            first[2] = 0.25
            self.assertTrue(np.all(second[2] == np.float32(0.25)), name)

    def test_shapes(self):
        gaussians = random_gaussians(5, coefficients=9)
        self.assertEqual(len(gaussians), 5)
        self.assertEqual(gaussians.sh_degree, 2)
        for name, width in NAMES.items():
            self.assertEqual(getattr(gaussians, name).shape, (5, width))
        self.assertEqual(gaussians.opacity_logits.shape, (5,))
        self.assertEqual(gaussians.sh.shape, (5, 9, 3))

    def test_a_view_keeps_its_owner_alive(self):
        gaussians = random_gaussians(1000)
        before = sys.getrefcount(gaussians)
        means = gaussians.means
        self.assertEqual(sys.getrefcount(gaussians), before + 1)
        wanted = means.copy()
        del gaussians
        gc.collect()
        noise = [np.full(3000, 7, np.float32) for _ in range(100)]  # would write over memory that was given back
        np.testing.assert_array_equal(means, wanted)
        self.assertEqual(len(noise), 100)

    def test_the_last_view_frees_its_owner(self):
        gaussians = random_gaussians(3)
        means = gaussians.means
        sh = gaussians.sh
        self.assertIs(means.base, gaussians)
        before = sys.getrefcount(gaussians)
        del means, sh
        self.assertEqual(sys.getrefcount(gaussians), before - 2)

    def test_writing_a_property_keeps_the_memory(self):
        gaussians = random_gaussians(4)
        view = gaussians.means
        gaussians.means = np.arange(12).reshape(4, 3)
        np.testing.assert_array_equal(view, np.arange(12, dtype=np.float32).reshape(4, 3))

    def test_empty(self):
        gaussians = hsi4d.Gaussians(np.zeros((0, 3)), np.zeros((0, 4)), np.zeros((0, 3)), np.zeros(0),
                                    np.zeros((0, 1, 3)))
        self.assertEqual(len(gaussians), 0)
        self.assertEqual(gaussians.means.shape, (0, 3))

    def test_copy_and_rows(self):
        gaussians = random_gaussians(6)
        copied = gaussians.copy()
        copied.means[:] = 0
        self.assertTrue(np.any(gaussians.means != 0))
        chosen = gaussians.selected([4, 1])
        np.testing.assert_array_equal(chosen.sh, gaussians.sh[[4, 1]])
        self.assertEqual(gaussians.with_sh_degree(0).sh.shape, (6, 1, 3))


class BadInput(unittest.TestCase):
    def check(self, message, function):
        with self.assertRaises(hsi4d.UserError) as caught:
            function()
        self.assertEqual(str(caught.exception), message)
        self.assertIsInstance(caught.exception, ValueError)

    def test_shapes_and_kinds(self):
        g = random_gaussians(5)
        self.check("means: an array [5,2]; allowed: [5,3], as sh has 5 rows",
                   lambda: hsi4d.Gaussians(np.zeros((5, 2)), g.quats, g.log_scales, g.opacity_logits, g.sh))
        self.check("quats: an array [4,4]; allowed: [5,4], as sh has 5 rows",
                   lambda: hsi4d.Gaussians(g.means, np.zeros((4, 4)), g.log_scales, g.opacity_logits, g.sh))
        self.check("sh: 5 coefficients a Gaussian; allowed: 1, 4, 9 or 16",
                   lambda: hsi4d.Gaussians(g.means, g.quats, g.log_scales, g.opacity_logits, np.zeros((5, 5, 3))))
        self.check("means: an array [5,3] of bool; allowed: [5,3], as sh has 5 rows of real numbers",
                   lambda: hsi4d.Gaussians(np.zeros((5, 3), bool), g.quats, g.log_scales, g.opacity_logits, g.sh))
        self.check("means: an array [5,3] of complex128; allowed: [5,3] of real numbers",
                   lambda: setattr(g, "means", np.zeros((5, 3), complex)))
        self.check("means: an array [] of <U2; allowed: [5,3] of real numbers", lambda: setattr(g, "means", "no"))
        self.check("rows: 5; allowed: 0 to 4", lambda: g.selected([5]))
        self.check("rows: -1; allowed: 0 to 4", lambda: g.selected([-1]))
        self.check("rows: an array of float64 with 1 axes; allowed: [M] of whole numbers", lambda: g.selected([0.5]))
        self.check("degree: 4; allowed: 0 to 3", lambda: g.with_sh_degree(4))

    def test_names(self):
        with self.assertRaises(AttributeError):
            random_gaussians(1).mean = 1


class Files(unittest.TestCase):
    def test_ply_gives_the_same_bits(self):
        folder = scratch()
        gaussians = random_gaussians(20)
        self.assertEqual(hsi4d.write_gaussians(folder / "g.ply", gaussians), [])
        read = hsi4d.read_gaussians(folder / "g.ply")
        for name in ["means", "quats", "log_scales", "opacity_logits", "sh"]:
            np.testing.assert_array_equal(getattr(read, name), getattr(gaussians, name))

    def test_every_format(self):
        folder = scratch()
        gaussians = random_gaussians(300)
        for name in ["g.compressed.ply", "g.splat", "g.spz"]:
            hsi4d.write_gaussians(folder / name, gaussians)
            read = hsi4d.read_gaussians(str(folder / name))
            self.assertEqual(len(read), 300)
            distances = np.linalg.norm(read.means[:, None] - gaussians.means[None], axis=2)  # writers may sort
            self.assertLess(distances.min(axis=0).max(), 3e-3)

    def test_origin(self):
        folder = scratch()
        hsi4d.write_gaussians(folder / "g.ply", random_gaussians(3))
        moved = hsi4d.read_gaussians(folder / "g.ply", origin_world=(1, 2, 3))
        np.testing.assert_array_equal(moved.origin_world, [1, 2, 3])
        np.testing.assert_allclose(moved.means + [1, 2, 3], hsi4d.read_gaussians(folder / "g.ply").means, atol=1e-6)

    def test_errors(self):
        folder = scratch()
        with self.assertRaisesRegex(hsi4d.UserError, "nothing.ply"):
            hsi4d.read_gaussians(folder / "nothing.ply")
        (folder / "bad.ply").write_text("ply\nformat ascii 1.0\nelement vertex 1\n")
        with self.assertRaisesRegex(hsi4d.DataError, "bad.ply"):
            hsi4d.read_gaussians(folder / "bad.ply")
        with self.assertRaisesRegex(hsi4d.UserError, "g.obj"):
            hsi4d.write_gaussians(folder / "g.obj", random_gaussians(1))


if __name__ == "__main__":
    unittest.main()
