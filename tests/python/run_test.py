"""Configs and runs: progress, stops, the log, the folder."""

import json
import logging
import os
import shutil
import signal
import threading
import time
import unittest

import numpy as np

import hsi4d
from support import SOURCE, config, dataset, program, scratch


class Configs(unittest.TestCase):
    def test_settings(self):
        settings = config({"seed": 5, "stages.camera.iterations": 3})
        self.assertEqual((settings.name, settings.stages), ("tiny", ["camera", "interaction"]))
        self.assertEqual(settings.settings["seed"], 5)
        self.assertEqual(settings.settings["stages"]["camera"]["iterations"], 3)
        self.assertEqual(config(["seed=5"]).settings["seed"], 5)

    def test_from_a_dict(self):
        made = hsi4d.make_config({"extends": "config.json", "seed": 7}, dataset().parent)
        self.assertEqual(made.settings, {**config().settings, "seed": 7})

    def test_all_that_is_wrong_is_told(self):
        with self.assertRaises(hsi4d.UserError) as caught:
            config({"seeed": 1, "stages.camera.iterations": -1, "stages.camera.losses.nothing": {}})
        for part in ["seeed", "/stages/camera/iterations", "nothing"]:
            self.assertIn(part, str(caught.exception))
        with self.assertRaisesRegex(hsi4d.UserError, "none.json"):
            hsi4d.load_config("none.json")
        with self.assertRaisesRegex(hsi4d.UserError, "overrides: a int"):
            config(7)
        with self.assertRaisesRegex(hsi4d.UserError, "overrides: a int; allowed: texts KEY=VALUE"):
            config([7])


class Runs(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.run_ = hsi4d.run(config(), scratch() / "run", threads=2)

    def test_the_folder(self):
        run = self.run_
        self.assertEqual(run.status["state"], "done")
        self.assertEqual(run.config["name"], "tiny")
        self.assertEqual(len(run.metrics), 3 * 18)
        self.assertEqual(run.metrics[0]["stage"], "camera")
        self.assertEqual([stage["stage"] for stage in run.summary["metrics"]], ["camera", "interaction"])
        self.assertEqual(len(run.motion), 4)
        self.assertEqual(len(run.cameras), 4)
        self.assertEqual(list(run.objects), ["watering_can"])
        self.assertEqual(run.image(2).shape, (48, 48, 3))
        self.assertEqual(run.image(2, "target").shape, (48, 48, 3))
        np.testing.assert_array_equal(run.states[2].objects[0][1], run.objects["watering_can"][1][2])
        self.assertEqual(hsi4d.Run(run.folder).summary, run.summary)

    def test_it_is_the_program_s(self):
        folder = scratch() / "run"
        program("run", dataset(), "--out", folder, "--quiet")
        other = hsi4d.Run(folder)
        np.testing.assert_array_equal(other.motion.rotations, self.run_.motion.rotations)
        self.assertEqual([line["loss"] for line in other.metrics], [line["loss"] for line in self.run_.metrics])

    def test_the_image_of_a_frame_again(self):
        run = self.run_
        data = dataset().parent
        state, camera = run.states[2], run.cameras[2]
        avatar = hsi4d.read_avatar(data / "avatar.safetensors")
        image = hsi4d.render([hsi4d.read_gaussians(data / "scene.ply"), avatar.pose(state.body)], camera, blur=0.13)
        self.assertLess(np.abs(np.clip(image, 0, 1) - run.image(2)).mean(), 0.05)  # the object is missing

    def test_without_objects(self):
        settings = json.loads(dataset().read_text())
        settings["data"]["objects"] = {}
        settings["stages"] = {"camera": settings["stages"]["camera"]}
        run = hsi4d.run(hsi4d.make_config(settings, dataset().parent), scratch() / "run")
        self.assertEqual(run.objects, {})
        self.assertEqual([state.objects for state in run.states], [[], [], [], []])

    def test_how_sure_places_are(self):
        self.assertEqual(self.run_.sigmas, {})
        self.assertIsNone(hsi4d.read_joint_sigma(self.run_.folder + "/motion.npz"))
        run = hsi4d.run(config({"uncertainty": True}), scratch() / "run")
        sigmas = run.sigmas
        self.assertEqual(list(sigmas), ["human", "watering_can"])
        self.assertEqual((sigmas["human"].shape, sigmas["watering_can"].shape), ((4, 22, 2), (4, 2)))
        for name in sigmas:
            self.assertTrue(np.isnan(sigmas[name][0]).all())  # frame 0 was given
            self.assertTrue((sigmas[name][1:] > 0).all())
        np.testing.assert_array_equal(hsi4d.read_joint_sigma(run.folder + "/motion.npz"), sigmas["human"])
        np.testing.assert_array_equal(np.load(run.folder + "/objects.npz")["watering_can/sigma"],
                                      sigmas["watering_can"])

    def test_no_run(self):
        with self.assertRaisesRegex(hsi4d.UserError, "holds no run"):
            hsi4d.Run(scratch())
        with self.assertRaisesRegex(hsi4d.UserError, "threads: -1"):
            hsi4d.run(config(), scratch() / "run", threads=-1)
        with self.assertRaisesRegex(hsi4d.UserError, "holds a run"):
            hsi4d.run(config(), self.run_.folder)


class SeveralPeople(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        """The shipped clip of two people, as small as it goes."""
        folder = scratch()
        program("synth", SOURCE / "configs/synthetic/two_people.json", "--out", folder / "data",
                "--set", "synthetic.frames=3", "--set", "synthetic.size_px=64", "--set", "synthetic.video=png",
                "--set", "synthetic.scene_gaussians=1500", "--set", "synthetic.avatar_gaussians=500")
        settings = json.loads((folder / "data" / "config.json").read_text())
        cls.config = hsi4d.load_config(
            folder / "data" / "config.json", {f"stages.{name}.iterations": 2 for name in settings["stages"]})
        cls.run_ = hsi4d.run(cls.config, folder / "run")

    def test_all_are_in_motions_and_states(self):
        run = self.run_
        self.assertEqual(list(run.motions), ["human", "friend"])
        np.testing.assert_array_equal(run.motions["human"].transl, run.motion.transl)
        self.assertEqual(len(run.states), 3)
        for t, state in enumerate(run.states):
            self.assertEqual(len(state.others), 1)
            np.testing.assert_array_equal(state.body.transl, run.motion.transl[t])
            np.testing.assert_array_equal(state.others[0].rotations, run.motions["friend"].rotations[t])
        self.assertGreater(np.abs(run.motions["friend"].transl - run.motion.transl).max(), 0.1)

    def test_a_stage_goes_on_from_its_states(self):
        run = self.run_
        stage = hsi4d.Stage(self.config, "interaction", frame=2, before=run.states[:2], start=run.states[2])
        np.testing.assert_array_equal(stage.state.others[0].transl, run.motions["friend"].transl[2])
        stage.step()
        self.assertTrue(np.isfinite(stage.evaluate()[0]))
        stage = hsi4d.Stage(self.config, "refinement", before=run.states)
        self.assertEqual([len(state.others) for state in stage.states], [1, 1, 1])
        np.testing.assert_array_equal(stage.states[1].others[0].transl, run.motions["friend"].transl[1])
        alone = [hsi4d.State(state.camera_from_world, state.body, state.objects) for state in run.states]
        with self.assertRaises(hsi4d.UserError):
            hsi4d.Stage(self.config, "refinement", before=alone)

    def test_a_motion_that_is_of_another_length(self):
        folder = scratch() / "copy"
        shutil.copytree(self.run_.folder, folder)
        motion = self.run_.motions["friend"]
        hsi4d.write_motion(folder / "motion_of_friend.npz", hsi4d.Motion(motion.transl[:2], motion.rotations[:2]))
        with self.assertRaisesRegex(hsi4d.DataError, "motion_of_friend.npz: it has 2 frames, .*cameras.json 3"):
            hsi4d.Run(folder).states


class Stops(unittest.TestCase):
    def check_resumed(self, folder, whole):
        self.assertEqual(hsi4d.Run(folder).status["state"], "interrupted")
        resumed = hsi4d.run(config(), folder, resume=True)
        np.testing.assert_array_equal(resumed.motion.rotations, whole.motion.rotations)

    @classmethod
    def setUpClass(cls):
        cls.whole = hsi4d.run(config(), scratch() / "run")

    def test_progress(self):
        seen = []
        hsi4d.run(config(), scratch() / "run", progress=seen.append, progress_interval=0)
        self.assertEqual([seen[0]["done"], seen[-1]["done"], seen[-1]["is_finished"]], [1, 54, True])
        self.assertEqual((seen[3]["task"], seen[3]["total"]), ("tiny", 54))
        self.assertEqual(set(seen[-2]["terms"]), {"photometric", "center", "depth"})
        self.assertIsInstance(seen[-2]["loss"], float)

    def test_false_stops(self):
        folder = scratch() / "run"
        with self.assertRaisesRegex(hsi4d.Interrupted, "interrupted in frame 2; frame 1 is finished and kept"):
            hsi4d.run(config(), folder, progress=lambda state: state["done"] < 25, progress_interval=0)
        self.check_resumed(folder, self.whole)

    def test_an_exception_stops(self):
        def stop(state):
            if state["done"] == 30:
                raise LookupError("enough")

        folder = scratch() / "run"
        with self.assertRaisesRegex(LookupError, "enough"):
            hsi4d.run(config(), folder, progress=stop, progress_interval=0)
        self.check_resumed(folder, self.whole)

    def test_ctrl_c_stops(self):
        def press(state):
            if state["done"] == 30:
                os.kill(os.getpid(), signal.SIGINT)

        folder = scratch() / "run"
        with self.assertRaises(KeyboardInterrupt):
            hsi4d.run(config(), folder, progress=press, progress_interval=0)
        self.check_resumed(folder, self.whole)

    def test_other_threads_go_on(self):
        counts = {"loops": 0, "stop": False}

        def count():
            while not counts["stop"]:
                counts["loops"] += 1
                time.sleep(0.001)

        thread = threading.Thread(target=count)
        thread.start()
        try:
            hsi4d.run(config(), scratch() / "run")
        finally:
            counts["stop"] = True
            thread.join()
        self.assertGreater(counts["loops"], 20)


class Log(unittest.TestCase):
    def test_a_function(self):
        lines = []
        with hsi4d.log_to(lambda level, text: lines.append((level, text))):
            hsi4d.run(config({"start.pose": "previous", "approx.hold_colors": True}), scratch() / "run")
        self.assertTrue(lines)
        self.assertTrue(all(level in {"info", "warning"} for level, _ in lines), lines)
        count = len(lines)
        hsi4d.run(config({"approx.hold_colors": True}), scratch() / "run")
        self.assertEqual(len(lines), count)

    def test_logging(self):
        with self.assertLogs("hsi4d.test", "INFO") as caught:
            sink = hsi4d.log_to(logging.getLogger("hsi4d.test"), level="info")
            hsi4d.run(config({"approx.hold_colors": True}), scratch() / "run")
            sink.close()
        self.assertTrue(any("hold_colors" in line for line in caught.output), caught.output)

    def test_from_several_threads(self):
        """Sinks take the interpreter from work that waits for the log, and the other way round."""
        lines = []
        bad = scratch() / "m.npz"
        np.savez(bad, poses=np.zeros((2, 156)), trans=np.zeros((2, 3)), betas=np.ones(10))  # SMPL-H: betas are left out
        with hsi4d.log_to(lambda level, text: lines.append(text), level="warning"):
            threads = [threading.Thread(target=lambda: [hsi4d.read_motion(bad) for _ in range(20)]) for _ in range(4)]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
        self.assertEqual(len(lines), 80)

    def test_bad_input(self):
        with self.assertRaisesRegex(hsi4d.UserError, 'level: "loud" is not known; allowed: trace, debug'):
            hsi4d.log_to(print, level="loud")
        with self.assertRaisesRegex(hsi4d.UserError, "target: a int; allowed: a function"):
            hsi4d.log_to(7)


class Sweeps(unittest.TestCase):
    def test_the_table_of_runs(self):
        folder = scratch()
        (folder / "sweep.json").write_text(json.dumps({
            "name": "few", "base": str(dataset()), "grid": {"stages.camera.iterations": [1, 2]}, "seeds": [0]}))
        program("sweep", folder / "sweep.json", "--out", folder / "sweep", "--quiet")
        rows = hsi4d.read_sweep(folder / "sweep")
        self.assertEqual([row["values"] for row in rows],
                         [{"stages.camera.iterations": 1}, {"stages.camera.iterations": 2}])
        self.assertEqual([row["state"] for row in rows], ["done", "done"])
        self.assertGreater(rows[0]["metrics"]["psnr_db"], 5)
        self.assertEqual(hsi4d.Run(rows[1]["folder"]).config["stages"]["camera"]["iterations"], 2)
        with self.assertRaises(hsi4d.UserError):
            hsi4d.read_sweep(scratch())


if __name__ == "__main__":
    unittest.main()
