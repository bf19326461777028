"""Loss terms in Python."""

import gc
import unittest
import weakref

import numpy as np

import hsi4d
from support import config, config_with_loss, scratch


def masked_l2(rendered, target, weight):
    """As optim/losses/masked_l2.cpp has it, operation by operation."""
    difference = rendered - target
    each = rendered.dtype.type(1.0 / rendered.size)
    weighted = difference * difference if weight is None else weight * (difference * difference)
    value = rendered.dtype.type(np.sum(weighted, dtype=np.float64)) * each
    slope = difference + difference
    return value, {"rendered": each * slope if weight is None else each * weight * slope}


class Twins(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        hsi4d.register_loss("l2_in_python", "Squared difference", masked_l2, ["rendered", "target", "weight"])

    def check(self, stage, overrides, threads=0, rounding=0):
        """rounding: relative, of a sum of doubles in another order; none of it is left in float."""
        known = {"camera": ["masked_l2"], "interaction": ["photometric", "center", "depth"]}[stage]
        both = []
        for name in ["masked_l2", "l2_in_python"]:
            only = {f"stages.{stage}.losses.{other}.weight": 0 for other in known if other != name}
            both.append(hsi4d.Stage(config_with_loss(stage, name, {**overrides, **only}), stage, 1, threads=threads))
        for _ in range(5):
            (loss, gradients), (twin_loss, twin_gradients) = [each.evaluate() for each in both]
            self.assertLessEqual(abs(twin_loss - loss), rounding * loss)
            for name in gradients:
                self.assertGreater(np.abs(gradients[name]).max(), 0)
                np.testing.assert_array_equal(twin_gradients[name], gradients[name])
            for each in both:
                each.step()
        for name, numbers in both[0].parameters.items():
            np.testing.assert_array_equal(both[1].parameters[name], numbers)

    def test_the_camera_s_loss(self):
        """With a weight."""
        self.check("camera", {})

    def test_the_whole_image(self):
        self.check("interaction", {}, threads=2)

    def test_in_double(self):
        self.check("interaction", {"precision": "double"}, rounding=1e-15)

    def test_gradients_are_checked(self):
        stage = hsi4d.Stage(config_with_loss("camera", "l2_in_python"), "camera", 1)
        self.assertTrue(stage.check_gradients(entries=6)["ok"])

    def test_a_run(self):
        settings = config_with_loss("camera", "l2_in_python", {"stages.camera.losses.masked_l2.weight": 0})
        self.assertEqual(settings.settings["stages"]["camera"]["losses"]["l2_in_python"], {"weight": 1.0})
        runs = [hsi4d.run(each, scratch() / "run") for each in [config(), settings]]
        np.testing.assert_array_equal(runs[0].motion.transl, runs[1].motion.transl)
        for a, b in zip(runs[0].cameras, runs[1].cameras):
            np.testing.assert_array_equal(a.camera_from_world, b.camera_from_world)


class Wrong(unittest.TestCase):
    def stage(self, function, needs=("rendered",), name="wrong", stage="camera"):
        hsi4d.register_loss(name, "Wrong", function, list(needs))
        return hsi4d.Stage(config_with_loss(stage, name), stage, 1)

    def test_a_wrong_adjoint_is_found(self):
        def half(rendered):
            return float(np.sum(rendered.astype(float)**2)), {"rendered": rendered}

        self.assertFalse(self.stage(half).check_gradients(entries=6)["ok"])

    def test_what_the_function_may_return(self):
        cases = [
            (lambda rendered: 1.0, r"loss wrong: it returns a float; allowed: a pair \(value, \{input: adjoint\}\)"),
            (lambda rendered: ("no", {}), "loss wrong: its value is a str; allowed: a number"),
            (lambda rendered: (1.0, [rendered]), "loss wrong: its adjoints are a list"),
            (lambda rendered: (1.0, {"renderd": rendered}),
             'loss wrong: it gives an adjoint of "renderd"; did you mean "rendered"\\?; allowed: rendered'),
            (lambda rendered: (1.0, {"rendered": rendered[0]}),
             r"loss wrong: the adjoint of rendered: an array \[48,48\]; allowed: \[3,48,48\]"),
        ]
        for function, message in cases:
            with self.subTest(message), self.assertRaisesRegex(hsi4d.UserError, message):
                self.stage(function).evaluate()

    def test_what_it_raises_comes_through(self):
        def fails(rendered):
            raise KeyError("mine")

        stage = self.stage(fails)
        with self.assertRaisesRegex(KeyError, "mine"):
            stage.step()
        folder = scratch() / "run"
        with self.assertRaisesRegex(KeyError, "mine"):
            hsi4d.run(config_with_loss("camera", "wrong"), folder)
        self.assertEqual(hsi4d.Run(folder).status["state"], "failed")

    def test_a_value_that_is_no_number(self):
        def broken(rendered):
            return float("nan"), {"rendered": np.zeros_like(rendered)}

        hsi4d.register_loss("broken", "No number", broken, ["rendered"])
        settings = config_with_loss("camera", "broken", {"stages.camera.optimizer.max_rollbacks": 2})
        stage = hsi4d.Stage(settings, "camera", 1)
        with self.assertRaisesRegex(hsi4d.StageDivergedError, "max_rollbacks is 2.*nan") as caught:
            while not stage.is_done:
                self.assertTrue(stage.step()["rolled_back"])
        self.assertIsInstance(caught.exception, hsi4d.UserError)

    def test_registration(self):
        cases = [
            (("masked_l2", "", masked_l2, ["rendered"]), "is a loss term of the library"),
            (("a b", "", masked_l2, ["rendered"]), "allowed: letters, digits and _"),
            (("mine", "", 7, ["rendered"]), "function: a int; allowed: a function"),
            (("mine", "", masked_l2, ["renderd"]), 'needs: there is no input "renderd"; did you mean "rendered"?'),
            (("mine", "", masked_l2, ["rendered", "rendered"]), 'needs: "rendered" is named twice'),
            (("mine", "", masked_l2, ["weight"]), "needs: allowed: one or more of"),
            (("mine", "", masked_l2, []), "needs: allowed: one or more of"),
            (("mine", "", masked_l2, ["rendered"], -1), "weight: -1; allowed: 0 or more"),
        ]
        for arguments, message in cases:
            with self.subTest(message), self.assertRaises(hsi4d.UserError) as caught:
                hsi4d.register_loss(*arguments)
            self.assertIn(message, str(caught.exception))
        self.assertNotIn("mine", hsi4d.losses())
        with self.assertRaisesRegex(hsi4d.UserError, "mine"):
            config_with_loss("camera", "mine")

    def test_a_missing_input_switches_it_off(self):
        def none(keypoints):
            return 0.0, {}

        self.assertEqual(self.stage(none, ["keypoints"], "of_keypoints", "interaction").off, ["of_keypoints"])

    def test_a_config_keeps_the_function_that_it_was_loaded_with(self):
        def one(rendered):
            return 1.0, {"rendered": np.zeros_like(rendered)}

        def two(rendered):
            return 2.0, {"rendered": np.zeros_like(rendered)}

        first = self.stage(one, name="changes")
        second = self.stage(two, name="changes")
        for stage, value in [(first, 1.0), (second, 2.0)]:
            stage.evaluate()
            self.assertEqual(stage.terms["changes"], value)

    def test_functions_are_let_go(self):
        class Function:
            def __call__(self, rendered):
                return 0.0, {"rendered": np.zeros_like(rendered)}

        function = Function()
        seen = weakref.ref(function)
        stage = self.stage(function, name="let_go")
        stage.step()
        hsi4d.register_loss("let_go", "Another", lambda rendered: (0.0, {}), ["rendered"])
        del function, stage
        gc.collect()
        self.assertIsNone(seen())


class Inputs(unittest.TestCase):
    def test_shapes(self):
        seen = {}

        def look(**inputs):
            seen.update({name: array.shape for name, array in inputs.items()})
            return 0.0, {"rendered": np.zeros_like(inputs["rendered"])}

        names = ["rendered", "target", "object_opacity", "object_center_target", "object_masks", "object_seen",
                 "object_place", "object_depth", "object_depth_target", "human_opacity", "human_mask", "human_seen",
                 "body_rotations", "joints", "joints_start"]
        hsi4d.register_loss("sees_all", "Sees all", look, names)
        stage = hsi4d.Stage(config_with_loss("interaction", "sees_all"), "interaction", 1)
        stage.evaluate()
        self.assertEqual(seen, {
            "rendered": (3, 48, 48), "target": (3, 48, 48), "object_opacity": (1, 48, 48),
            "object_center_target": (1, 3), "object_masks": (1, 48, 48), "object_seen": (1, 1, 1),
            "object_place": (1, 2), "object_depth": (1, 1), "object_depth_target": (1, 1),
            "human_opacity": (1, 48, 48), "human_mask": (1, 48, 48), "human_seen": (1, 1),
            "body_rotations": (21, 9), "joints": (2, 66), "joints_start": (2, 66)})
        self.assertLess(set(names), set(hsi4d.loss_inputs()))


if __name__ == "__main__":
    unittest.main()
