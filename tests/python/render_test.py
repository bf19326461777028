"""Renders and their gradients."""

import json
import unittest

import numpy as np

import hsi4d
from support import camera, program, random_gaussians, scratch


class Images(unittest.TestCase):
    def test_the_image_is_the_program_s(self):
        folder = scratch()
        gaussians = random_gaussians(200)
        hsi4d.write_gaussians(folder / "g.ply", gaussians)
        hsi4d.write_camera(folder / "c.json", camera())
        program("render", "--scene", folder / "g.ply", "--camera", folder / "c.json", "--background", "0.1,0.2,0.3",
                "--set", "render.quality=accurate", "--out", folder / "i.exr")
        image = hsi4d.render(gaussians, camera(), background=(0.1, 0.2, 0.3), quality="accurate")
        self.assertEqual((image.shape, image.dtype), ((32, 40, 3), np.float32))
        np.testing.assert_array_equal(image, hsi4d.read_image(folder / "i.exr"))

    def test_precisions_agree(self):
        gaussians = random_gaussians(100)
        images = [hsi4d.render(gaussians, camera(), precision=precision, quality="reference")
                  for precision in ["float", "double", "reference"]]
        self.assertEqual(images[1].dtype, np.float64)
        np.testing.assert_allclose(images[1], images[2], atol=1e-12)
        np.testing.assert_allclose(images[0], images[2], atol=1e-4)

    def test_layers(self):
        gaussians = random_gaussians(100)
        layers = hsi4d.render_layers(gaussians, camera(), background=(1, 1, 1), precision="double")
        black = hsi4d.render(gaussians, camera(), precision="double")
        np.testing.assert_allclose(layers["image"], black + (1 - layers["alpha"])[:, :, None], atol=1e-12)
        seen = layers["depth"][layers["alpha"] > 0.5]
        self.assertTrue(np.all((seen > 1) & (seen < 5)))

    def test_several_sets(self):
        gaussians = random_gaussians(60)
        halves = [gaussians.selected(range(30)), gaussians.selected(range(30, 60))]
        np.testing.assert_array_equal(hsi4d.render(halves, camera()), hsi4d.render(gaussians, camera()))
        avatar = hsi4d.make_avatar(hsi4d.procedural_body(), 300)
        alone = hsi4d.render(avatar.pose(hsi4d.rest_pose()), camera())
        self.assertGreater(alone.max(), 0.1)
        self.assertFalse(np.array_equal(hsi4d.render([gaussians, avatar.pose(hsi4d.rest_pose())], camera()), alone))

    def test_settings_as_keywords_dict_and_text(self):
        gaussians = random_gaussians(60)
        image = hsi4d.render(gaussians, camera(), blur=1.5, antialias=True)
        for settings in [{"blur": 1.5, "antialias": True}, json.dumps({"blur": 1.5, "antialias": True})]:
            np.testing.assert_array_equal(hsi4d.render(gaussians, camera(), settings=settings), image)
        np.testing.assert_array_equal(hsi4d.render(gaussians, camera(), settings={"blur": 9}, blur=1.5, antialias=True),
                                      image)
        self.assertEqual(hsi4d.render_settings(quality="accurate")["alpha_min"], 2e-6)
        self.assertEqual(hsi4d.render_settings()["quality"], "default")

    def test_threads_change_no_bit(self):
        gaussians = random_gaussians(500)
        np.testing.assert_array_equal(hsi4d.render(gaussians, camera(), threads=1),
                                      hsi4d.render(gaussians, camera(), threads=3))


class Gradients(unittest.TestCase):
    def setUp(self):
        self.gaussians = random_gaussians(12)
        self.camera = camera(24, 20)
        self.cotangent = np.random.default_rng(8).normal(size=(20, 24, 3))
        self.keywords = {"background": (0.3, 0.1, 0.6), "precision": "double", "quality": "reference"}

    def loss(self, gaussians, view=None, **changed):
        image = hsi4d.render(gaussians, view or self.camera, **{**self.keywords, **changed})
        return float(np.sum(image * self.cotangent))

    def check(self, gradient, difference):
        self.assertLess(abs(gradient - difference), 2e-4 * (1 + abs(difference)))

    def test_against_central_differences(self):
        gradients = hsi4d.render_gradients(self.gaussians, self.camera, self.cotangent, **self.keywords)
        random = np.random.default_rng(9)
        for name in ["means", "quats", "log_scales", "opacity_logits", "sh"]:
            values = getattr(self.gaussians, name)
            self.assertEqual(gradients[name].shape, values.shape)
            for _ in range(6):
                place = tuple(random.integers(0, size) for size in values.shape)
                at = values[place]
                high, low = np.float32(at + 2.0**-9), np.float32(at - 2.0**-9)  # what floats hold, and no more
                losses = []
                for number in [high, low]:
                    values[place] = number
                    losses.append(self.loss(self.gaussians))
                values[place] = at
                self.check(gradients[name][place], (losses[0] - losses[1]) / (float(high) - float(low)))

    def test_of_the_camera(self):
        gradients = hsi4d.render_gradients(self.gaussians, self.camera, self.cotangent, **self.keywords)
        step = 1e-5
        for i in range(6):
            losses = []
            for sign in [1, -1]:
                xi = np.zeros(6)
                xi[i] = sign * step
                move = np.eye(4)
                move[:3, 3] = xi[:3]
                angle = xi[3:]
                cross = np.array([[0, -angle[2], angle[1]], [angle[2], 0, -angle[0]], [-angle[1], angle[0], 0]])
                move[:3, :3] += cross + cross @ cross / 2  # of this size exact to 1e-15
                losses.append(self.loss(self.gaussians, self.camera.moved(move @ self.camera.camera_from_world)))
            self.check(gradients["camera"][i], (losses[0] - losses[1]) / (2 * step))

    def test_of_the_background(self):
        """The image is linear in it."""
        for precision in ["float", "double", "reference"]:
            gradients = hsi4d.render_gradients(self.gaussians, self.camera, self.cotangent,
                                               **{**self.keywords, "precision": precision})
            for c in range(3):
                one, none = np.zeros(3), np.zeros(3)
                one[c] = 1
                difference = self.loss(self.gaussians, background=one) - self.loss(self.gaussians, background=none)
                self.assertLess(abs(gradients["background"][c] - difference),
                                (1e-3 if precision == "float" else 1e-9) * (1 + abs(difference)))

    def test_float_agrees_with_double(self):
        exact = hsi4d.render_gradients(self.gaussians, self.camera, self.cotangent, **self.keywords)
        rounded = hsi4d.render_gradients(self.gaussians, self.camera, self.cotangent,
                                         **{**self.keywords, "precision": "float"})
        np.testing.assert_allclose(rounded["image"], exact["image"], atol=1e-4)
        for name in ["means", "sh", "camera"]:
            self.assertEqual(rounded[name].dtype, np.float32)
            np.testing.assert_allclose(rounded[name], exact[name], atol=2e-3 * np.abs(exact[name]).max())


class BadInput(unittest.TestCase):
    def test_messages(self):
        gaussians = random_gaussians(3)
        posed = hsi4d.make_avatar(hsi4d.procedural_body(), 100).pose(hsi4d.rest_pose())
        cases = [
            (lambda: hsi4d.render(gaussians, camera(), precision="half"),
             'precision: "half" is not known; allowed: float, double, reference'),
            (lambda: hsi4d.render(gaussians, camera(), background=(0, 0)), "background: an array"),
            (lambda: hsi4d.render([], camera()), "gaussians: a list; allowed: Gaussians, or a list of some"),
            (lambda: hsi4d.render(7, camera()), "gaussians: a int; allowed"),
            (lambda: hsi4d.render([gaussians, 7], camera()), r"gaussians\[1\]: a int; allowed: Gaussians"),
            (lambda: hsi4d.render(gaussians, camera(), alpha_mn=0), "alpha_mn"),
            (lambda: hsi4d.render(gaussians, camera(), alpha_min=-1), "alpha_min"),
            (lambda: hsi4d.render(gaussians, camera(), settings="[1]"), "settings: allowed: a JSON object"),
            (lambda: hsi4d.render(gaussians, camera(), threads=-1), "threads: -1; allowed"),
            (lambda: hsi4d.render_gradients(gaussians, camera(), np.zeros((32, 40))),
             r"cotangent: an array \[32,40\]; allowed: \[32,40,3\], as the camera's image"),
            (lambda: hsi4d.render_gradients(posed, camera(), np.zeros((32, 40, 3))), "bent by a body's pose"),
        ]
        for function, message in cases:
            with self.subTest(message), self.assertRaisesRegex(hsi4d.UserError, message):
                function()
        with self.assertRaises(TypeError):
            hsi4d.render(gaussians)


if __name__ == "__main__":
    unittest.main()
