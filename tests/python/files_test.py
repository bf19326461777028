"""Cameras, images, keypoints, bodies, motions, avatars and their files."""

import unittest

import numpy as np

import hsi4d
from support import camera, dataset, scratch


class Cameras(unittest.TestCase):
    def test_round_trip(self):
        folder = scratch()
        hsi4d.write_camera(folder / "c.json", camera())
        read = hsi4d.read_camera(folder / "c.json")
        np.testing.assert_array_equal(read.camera_from_world, camera().camera_from_world)
        self.assertEqual((read.width, read.height, read.fx), (40, 32, 44))
        hsi4d.write_cameras(folder / "several.json", [camera(), camera(20, 10)])
        self.assertEqual([c.width for c in hsi4d.read_cameras(folder / "several.json")], [40, 20])
        self.assertEqual(hsi4d.read_camera(folder / "several.json", 1).height, 10)

    def test_places(self):
        np.testing.assert_allclose(camera().center_world, [0.2, -3, 0.4], atol=1e-12)
        self.assertEqual(camera().resized(20, 16).fx, 22)
        moved = camera().moved(np.eye(4))
        np.testing.assert_array_equal(moved.camera_from_world, np.eye(4))

    def test_bad_input(self):
        with self.assertRaisesRegex(hsi4d.UserError, r"camera_from_world: an array \[3,3\]; allowed: \[4,4\]"):
            hsi4d.Camera(4, 4, 1, 1, 2, 2, np.eye(3))
        with self.assertRaises(hsi4d.UserError):
            hsi4d.Camera(4, 4, -1, 1, 2, 2, np.eye(4))
        with self.assertRaises(hsi4d.UserError):
            hsi4d.Camera(4, 4, 1, 1, 2, 2, np.diag([1, 1, -1, 1]))
        with self.assertRaisesRegex(hsi4d.UserError, r"eye: an array \[2\]"):
            hsi4d.look_at((0, 0), (1, 1, 1))
        with self.assertRaises(TypeError):
            hsi4d.Camera(4.5, 4, 1, 1, 2, 2, np.eye(4))


class Images(unittest.TestCase):
    def test_round_trips(self):
        folder = scratch()
        image = np.random.default_rng(2).uniform(0, 1, (7, 9, 3)).astype(np.float32)
        hsi4d.write_image(folder / "i.exr", image)
        np.testing.assert_array_equal(hsi4d.read_image(folder / "i.exr"), image)
        hsi4d.write_image(folder / "i.png", image, png_bits=16)
        np.testing.assert_allclose(hsi4d.read_image(folder / "i.png"), image, atol=0.51 / 65535)
        hsi4d.write_image(folder / "grey.png", image[:, :, 0])
        self.assertEqual(hsi4d.read_image(folder / "grey.png").shape, (7, 9, 1))

    def test_what_openimageio_reads(self):
        """A portable pixmap: its reader is in a library that is loaded when it is first needed."""
        folder = scratch()
        (folder / "i.ppm").write_bytes(b"P6\n2 1\n255\n" + bytes([255, 0, 51, 0, 102, 255]))
        np.testing.assert_allclose(hsi4d.read_image(folder / "i.ppm"), [[[1, 0, 0.2], [0, 0.4, 1]]], atol=1e-6)

    def test_bad_input(self):
        folder = scratch()
        with self.assertRaisesRegex(hsi4d.UserError, r"image: an array \[4\]; allowed: \[H,W\] or \[H,W,C\]"):
            hsi4d.write_image(folder / "i.png", np.zeros(4))
        with self.assertRaises(hsi4d.UserError):
            hsi4d.write_image(folder / "i.png", np.zeros((4, 4, 7)))
        with self.assertRaises(hsi4d.DataError):
            hsi4d.write_image(folder / "i.png", np.full((4, 4), np.nan))
        with self.assertRaisesRegex(hsi4d.UserError, "none.png"):
            hsi4d.read_image(folder / "none.png")


class Keypoints(unittest.TestCase):
    def test_round_trip(self):
        folder = scratch()
        points = np.arange(51.0).reshape(17, 3)
        points[:, 2] = 0.5
        hsi4d.write_keypoints(folder / "k.json", [points, None], "coco17", size=(640, 480))
        read = hsi4d.read_keypoints(folder / "k.json")
        np.testing.assert_array_equal(read["frames"][0][0], points)
        self.assertEqual(read["frames"][1], [])
        self.assertEqual(read["size"], (640, 480))
        self.assertEqual(read["joints"][5], {"left_shoulder": 1.0})

    def test_bad_input(self):
        folder = scratch()
        with self.assertRaisesRegex(hsi4d.UserError, r"frames\[0\]: an array \[17,2\]; allowed: \[P,3\]"):
            hsi4d.write_keypoints(folder / "k.json", [np.zeros((17, 2))], "coco17")
        with self.assertRaises(hsi4d.DataError):
            hsi4d.write_keypoints(folder / "k.json", [np.zeros((16, 3))], "coco17")
        self.assertFalse((folder / "k.json").exists())


class Bodies(unittest.TestCase):
    def pose(self):
        rotations = np.random.default_rng(3).uniform(-0.2, 0.2, (55, 3))
        return hsi4d.BodyPose((0.1, 0.2, 1.1), rotations)

    def test_a_body_is_posed(self):
        body = hsi4d.procedural_body()
        joints, vertices = body.pose(hsi4d.rest_pose())
        np.testing.assert_allclose(joints, body.joints, atol=1e-12)
        np.testing.assert_allclose(vertices, body.vertices, atol=1e-6)
        moved = hsi4d.BodyPose((1, 2, 3), np.zeros((55, 3)))
        np.testing.assert_allclose(body.pose(moved)[1], body.vertices + np.array([1, 2, 3]), atol=1e-6)
        self.assertFalse(body.vertices.flags.writeable)
        self.assertEqual(body.faces.shape[1], 3)
        self.assertEqual(body.parents[0], -1)
        self.assertEqual(body.joint_names[0], "pelvis")

    def test_an_avatar_is_posed(self):
        body = hsi4d.procedural_body()
        avatar = hsi4d.make_avatar(body, 300, seed=4)
        self.assertEqual(len(avatar), 300)
        np.testing.assert_allclose(avatar.pose_joints(self.pose()), body.pose(self.pose())[0], atol=1e-9)
        posed = avatar.pose(self.pose())
        self.assertEqual(posed.transforms.shape, (300, 3, 4))
        self.assertFalse(posed.transforms.flags.writeable)
        means = np.einsum("nij,nj->ni", posed.transforms[:, :, :3], posed.means) + posed.transforms[:, :, 3]
        rest = avatar.pose(hsi4d.rest_pose())
        np.testing.assert_allclose(rest.transforms, np.tile(np.eye(3, 4), (300, 1, 1)), atol=1e-6)
        self.assertLess(np.abs(means - means.mean(0)).max(), 2.5)

    def test_files_of_avatars(self):
        folder = scratch()
        avatar = hsi4d.make_avatar(hsi4d.procedural_body(), 100)
        avatar.colors[:] = 0.5
        hsi4d.write_avatar(folder / "a.safetensors", avatar)
        np.testing.assert_array_equal(hsi4d.read_avatar(folder / "a.safetensors").colors, np.full((100, 3), 0.5))

    def test_files_of_motions(self):
        folder = scratch()
        random = np.random.default_rng(5)
        motion = hsi4d.Motion(random.normal(size=(4, 3)), random.uniform(-0.3, 0.3, (4, 55, 3)), frame_rate=25,
                              pelvis_rest=(0, -0.35, 0))
        hsi4d.write_motion(folder / "m.npz", motion)
        read = hsi4d.read_motion(folder / "m.npz")
        np.testing.assert_array_equal(read.rotations, motion.rotations)
        np.testing.assert_array_equal(read.transl, motion.transl)
        np.testing.assert_array_equal(read[-1].transl, motion.transl[3])
        np.testing.assert_array_equal(read.pelvis_rest, [0, -0.35, 0])
        self.assertEqual((len(read), read.frame_rate, read.gender), (4, 25, "neutral"))
        self.assertEqual(len(list(read)), 4)
        with self.assertRaises(IndexError):
            read[4]

    def test_how_sure_a_motion_is(self):
        file = scratch() / "m.npz"
        motion = hsi4d.Motion(np.zeros((4, 3)), np.zeros((4, 55, 3)))
        hsi4d.write_motion(file, motion)
        self.assertIsNone(hsi4d.read_joint_sigma(file))
        sigma = np.random.default_rng(7).uniform(0, 1, (4, 22, 2))
        sigma[0], sigma[1, 3] = np.nan, np.inf
        hsi4d.write_motion(file, motion, joint_sigma=sigma)
        np.testing.assert_array_equal(hsi4d.read_joint_sigma(file), sigma)
        np.testing.assert_array_equal(np.load(file)["joint_sigma"], sigma)
        np.testing.assert_array_equal(hsi4d.read_motion(file).transl, motion.transl)
        for wrong, text in [(sigma[:3], r"allowed: \[4,J,2\]"), (sigma[..., :1], "joint_sigma"),
                            (-sigma, "allowed: 0 or more")]:
            with self.assertRaisesRegex(hsi4d.UserError, text):
                hsi4d.write_motion(file, motion, wrong)

    def test_tracks(self):
        folder = scratch()
        random = np.random.default_rng(6)
        tracks = {name: (random.normal(size=(3, 3)), random.normal(size=(3, 3))) for name in ["chair", "cup"]}
        hsi4d.write_object_tracks(folder / "o.npz", tracks)
        read = hsi4d.read_object_tracks(folder / "o.npz")
        self.assertEqual(list(read), ["chair", "cup"])
        for name in tracks:
            np.testing.assert_array_equal(read[name][0], tracks[name][0])
            np.testing.assert_array_equal(read[name][1], tracks[name][1])

    def test_bad_input(self):
        body = hsi4d.procedural_body()
        with self.assertRaisesRegex(hsi4d.UserError, "pose: it has 54 joints; the body has 55"):
            body.pose(hsi4d.rest_pose(54))
        with self.assertRaisesRegex(hsi4d.UserError, r"rotations: an array \[4,54,3\]; allowed: \[4,55,3\]"):
            hsi4d.Motion(np.zeros((4, 3)), np.zeros((4, 54, 3)))
        with self.assertRaisesRegex(hsi4d.UserError, "frame_rate"):
            hsi4d.Motion(np.zeros((4, 3)), np.zeros((4, 55, 3)), frame_rate=0)
        with self.assertRaisesRegex(hsi4d.UserError, r"cup translations: an array \[2,3\]"):
            hsi4d.write_object_tracks("o.npz", {"cup": (np.zeros((3, 3)), np.zeros((2, 3)))})
        with self.assertRaisesRegex(hsi4d.UserError, r"objects\[0\]: allowed: a pair"):
            hsi4d.State(np.eye(4), hsi4d.rest_pose(), [np.zeros(3)])
        with self.assertRaisesRegex(hsi4d.UserError, "lights: 1; allowed: none, or one an object, of which there are 0"):
            hsi4d.State(np.eye(4), hsi4d.rest_pose(), [], lights=[[0] * 6])

    def test_a_state_has_the_lights_that_it_is_given(self):
        cup = [(np.zeros(3), np.zeros(3))]
        self.assertEqual(hsi4d.State(np.eye(4), hsi4d.rest_pose(), cup).lights, [])
        light = [0.1, 0.2, 0.3, -0.4, 0.5, 0.6]
        self.assertEqual(hsi4d.State(np.eye(4), hsi4d.rest_pose(), cup, lights=[light]).lights, [light])

    def test_the_files_of_a_dataset(self):
        data = dataset().parent
        self.assertEqual(len(hsi4d.read_avatar(data / "avatar.safetensors")), 500)
        self.assertGreater(len(hsi4d.read_gaussians(data / "scene.ply")), 1000)
        self.assertEqual(hsi4d.read_camera(data / "camera.json").width, 48)


if __name__ == "__main__":
    unittest.main()
