"""A stage at hand: the bits of a run, gradients, parameters."""

import threading
import unittest

import numpy as np

import hsi4d
from support import config, config_with, config_with_loss, scratch


BFGS = {"stages.camera.optimizer.kind": "bfgs", "stages.camera.optimize.camera.lr_final_share": 1}


def all_steps(stage):
    while not stage.is_done:
        stage.step()


def check_same_state(test, a, b):
    np.testing.assert_array_equal(a.camera_from_world, b.camera_from_world)
    np.testing.assert_array_equal(a.body.transl, b.body.transl)
    np.testing.assert_array_equal(a.body.rotations, b.body.rotations)
    test.assertEqual(len(a.objects), len(b.objects))
    for (rotation, translation), (other_rotation, other_translation) in zip(a.objects, b.objects):
        np.testing.assert_array_equal(rotation, other_rotation)
        np.testing.assert_array_equal(translation, other_translation)


class Bits(unittest.TestCase):
    def check_whole_run(self, overrides):
        settings = config(overrides)
        run = hsi4d.run(settings, scratch() / "run")
        states = run.states
        losses = [line["loss"] for line in run.metrics]
        done, found = [states[0]], []
        for frame in range(1, 4):
            camera = hsi4d.Stage(settings, "camera", frame, before=done)
            while not camera.is_done:
                found.append(camera.step()["loss"])
            moving = hsi4d.Stage(settings, "interaction", frame, before=done, start=camera.state)
            while not moving.is_done:
                found.append(moving.step()["loss"])
            moving.finish()
            done.append(moving.state)
        for wanted, state in zip(states, done):
            check_same_state(self, state, wanted)
        self.assertEqual(found, losses)

    def test_stages_have_the_bits_of_a_run(self):
        self.check_whole_run({})

    def test_in_double_with_axis_angles(self):
        self.check_whole_run({"precision": "double", "rotations": "axis_angle"})

    def test_with_quasi_newton(self):
        self.check_whole_run(BFGS)

    def test_looking_changes_nothing(self):
        """Evaluations, images and gradient checks between the steps."""
        for overrides in [{}, {"approx.hold_colors": True}]:
            settings = config(overrides)
            plain, looked_at = [hsi4d.Stage(settings, "interaction", 1) for _ in range(2)]
            all_steps(plain)
            while not looked_at.is_done:
                looked_at.evaluate()
                looked_at.image()
                looked_at.step()
                looked_at.state
            looked_at.check_gradients(entries=1)
            for name, numbers in plain.parameters.items():
                np.testing.assert_array_equal(looked_at.parameters[name], numbers)

    def test_threads_change_no_bit(self):
        settings = config()
        stages = [hsi4d.Stage(settings, "interaction", 1, threads=threads) for threads in [1, 3]]
        for stage in stages:
            all_steps(stage)
        for name, numbers in stages[0].parameters.items():
            np.testing.assert_array_equal(stages[1].parameters[name], numbers)


class Evaluation(unittest.TestCase):
    def test_gradients_against_central_differences(self):
        stage = hsi4d.Stage(config({"precision": "double", "render.quality": "reference"}),
                            "interaction", 1)
        for _ in range(3):
            stage.step()
        parameters = stage.parameters
        loss, gradients = stage.evaluate()
        self.assertEqual(list(gradients), list(parameters))
        weighted = sum(stage.weights[name] * value for name, value in stage.terms.items())
        self.assertAlmostEqual(weighted, loss, places=12)
        random = np.random.default_rng(1)
        step = 1e-6
        for name, numbers in parameters.items():
            self.assertEqual(gradients[name].shape, numbers.shape)
            direction = random.normal(size=numbers.shape)
            losses = []
            for sign in [1, -1]:
                losses.append(stage.evaluate({**parameters, name: numbers + sign * step * direction})[0])
            difference = (losses[0] - losses[1]) / (2 * step)
            self.assertLess(abs(np.sum(gradients[name] * direction) - difference), 1e-3 * (abs(difference) + 1e-3), name)

    def test_parameters_are_written(self):
        stage = hsi4d.Stage(config(), "interaction", 1)
        before = stage.parameters
        moved = before["transl"] + np.float32(0.125)
        stage.parameters = {"transl": moved}
        np.testing.assert_array_equal(stage.parameters["transl"], moved)
        np.testing.assert_array_equal(stage.parameters["body_pose"], before["body_pose"])
        np.testing.assert_allclose(stage.state.body.transl, moved[0], atol=1e-6)
        first = stage.evaluate(before)
        again = stage.evaluate()
        self.assertEqual(first[0], again[0])
        for name in before:
            np.testing.assert_array_equal(first[1][name], again[1][name])
        stage.parameters["transl"][:] = 7  # of a copy
        np.testing.assert_array_equal(stage.parameters["transl"], before["transl"])

    def test_the_image_follows_the_parameters(self):
        stage = hsi4d.Stage(config(), "interaction", 1)
        image = stage.image()
        self.assertEqual(image.shape, stage.target.shape)
        self.assertLess(np.abs(image - stage.target).mean(), 0.2)
        stage.parameters = {"transl": stage.parameters["transl"] + 0.3}
        self.assertGreater(np.abs(stage.image() - image).max(), 0.05)

    def test_what_it_tells(self):
        stage = hsi4d.Stage(config({"stages.interaction.losses.center.weight": 0}), "interaction", 2)
        self.assertEqual((stage.name, stage.frame, stage.iteration, stage.iterations), ("interaction", 2, 0, 10))
        self.assertEqual(stage.off, ["center"])
        self.assertEqual(stage.objects, ["watering_can"])
        self.assertEqual(stage.parameters["object_transl"].shape, (1, 3))
        report = stage.step()
        self.assertEqual((report["iteration"], report["rolled_back"]), (0, False))
        self.assertEqual((stage.iteration, set(stage.terms)), (1, {"photometric", "depth"}))
        self.assertEqual(stage.camera.width, 48)
        self.assertEqual(hsi4d.Stage(config(), "camera").frame, 3)

    def test_gradients_are_checked(self):
        found = hsi4d.Stage(config(), "interaction", 1).check_gradients(entries=3)
        self.assertTrue(found["ok"], found)
        self.assertEqual(list(found["groups"]), ["transl", "global_orient", "body_pose", "object_orient", "object_transl"])
        self.assertGreater(found["groups"]["body_pose"]["tried"], 0)


class OverTheSequence(unittest.TestCase):
    SEQUENCE = {"refinement": {
        "over": "sequence", "iterations": 6,
        "optimize": {"transl": {"lr": 0.01}, "global_orient": {"lr": 0.01}},
        "losses": {"smooth": {}}}}

    def test_bits(self):
        settings = config_with(self.SEQUENCE)
        run = hsi4d.run(settings, scratch() / "run")
        frames = hsi4d.run(config(), scratch() / "frames").states
        stage = hsi4d.Stage(settings, "refinement", before=frames)
        all_steps(stage)
        stage.finish()
        for found, wanted in zip(stage.states, run.states):
            check_same_state(self, found, wanted)
        for function in [stage.image, lambda: stage.state, lambda: stage.camera]:
            with self.assertRaisesRegex(hsi4d.UserError, "over all frames at once"):
                function()


class BadInput(unittest.TestCase):
    def check(self, message, function):
        with self.assertRaises(hsi4d.UserError) as caught:
            function()
        self.assertEqual(str(caught.exception), message)

    def test_messages(self):
        settings = config()
        self.check('stage: the config has no stage "interacton"; known: camera, interaction; did you mean "interaction"?',
                   lambda: hsi4d.Stage(settings, "interacton"))
        self.check("frame: 9; allowed: 1 to 3", lambda: hsi4d.Stage(settings, "camera", 9))
        self.check("before: 0 states; the stage follows 1", lambda: hsi4d.Stage(settings, "camera", 1, before=[]))
        state = hsi4d.State(np.eye(4), hsi4d.rest_pose(), [])
        self.check("start: a state of 0 objects; the clip has 1",
                   lambda: hsi4d.Stage(settings, "camera", 1, start=state))
        stage = hsi4d.Stage(settings, "camera", 1)
        self.check("stage 'camera, frame 1': camera: an array [2,6]; allowed: [1,6]",
                   lambda: stage.evaluate({"camera": np.zeros((2, 6))}))
        self.check("camera: an array [6]; allowed: [rows,cols]", lambda: stage.evaluate({"camera": np.zeros(6)}))
        self.check("stage 'camera, frame 1': camera: nan; allowed: finite numbers",
                   lambda: stage.evaluate({"camera": np.full((1, 6), np.nan)}))
        with self.assertRaisesRegex(hsi4d.UserError, 'it moves no group "transl"'):
            stage.evaluate({"camera": np.zeros((1, 6)), "transl": np.zeros((1, 3))})
        self.check("parameters: a list; allowed: a dict of groups and arrays", lambda: stage.evaluate([1]))
        all_steps(stage)
        with self.assertRaisesRegex(hsi4d.UserError, "all its 8 iterations are done"):
            stage.step()
        stage.finish()
        with self.assertRaises(hsi4d.UserError):
            stage.finish()
        with self.assertRaises(TypeError):
            hsi4d.Stage("config.json", "camera")

    def test_bfgs_remembers(self):
        stage = hsi4d.Stage(config(BFGS), "camera", 1)
        stage.parameters = stage.parameters
        stage.step()
        with self.assertRaisesRegex(hsi4d.UserError, "bfgs remembers"):
            stage.parameters = stage.parameters


class Threads(unittest.TestCase):
    def test_stages_of_several_threads(self):
        settings = config()
        wanted = hsi4d.Stage(settings, "interaction", 1)
        all_steps(wanted)
        stages = [hsi4d.Stage(settings, "interaction", 1, threads=1) for _ in range(3)]
        threads = [threading.Thread(target=all_steps, args=(stage,)) for stage in stages]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        for stage in stages:
            for name, numbers in wanted.parameters.items():
                np.testing.assert_array_equal(stage.parameters[name], numbers)

    def test_one_stage_is_for_one_thread(self):
        messages = []

        def look(rendered):
            """Called while the stage is at work."""
            try:
                self.stage.parameters
            except hsi4d.UserError as error:
                messages.append(str(error))
            return 0.0, {"rendered": np.zeros_like(rendered)}

        hsi4d.register_loss("watch", "Looks at the stage", look, ["rendered"])
        self.stage = hsi4d.Stage(config_with_loss("camera", "watch"), "camera", 1)
        self.stage.step()
        self.assertEqual(messages, ["the stage is at work in another call; allowed: one call at a time, a stage for each "
                                    "thread"])


if __name__ == "__main__":
    unittest.main()
