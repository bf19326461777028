"""tools/mesh_measures.py against boxes, spheres and pictures whose answers are known, and that the meshes of
tools/textured_meshes.py are closed.

    python3 tests/tools/mesh_measures_test.py TOOLS
"""

import json
import pathlib
import struct
import sys
import tempfile
import unittest

try:
    import numpy as np
    import PIL  # noqa: F401, for textured_meshes
except ImportError:
    print("skipped: Python has no NumPy or no PIL")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(sys.argv.pop(1)).resolve()))

import mesh_measures as measures  # noqa: E402
import textured_meshes as meshes  # noqa: E402

LOW, HIGH = np.array([-0.5, -0.3, 0.1]), np.array([0.4, 0.7, 0.9])
RADIUS = 0.6


def box():
    return meshes.box(LOW, HIGH)[0]


SLACK = 2 * (1 - np.cos(np.pi / 120)) * RADIUS  # how deep faces of sphere() may be at most


def sphere(sides=120):
    return meshes.ball((RADIUS, RADIUS, RADIUS), sides)[0]


def random_points(count=20000, seed=1):
    return np.random.default_rng(seed).uniform(-1.2, 1.2, (count, 3))


def box_distance(points):
    """Signed, negative inside."""
    outside = np.maximum(LOW - points, points - HIGH)
    return np.linalg.norm(np.maximum(outside, 0), axis=1) + np.minimum(outside.max(1), 0)


def camera(eye, size=200, focal=100):
    """Looks along +y, z up."""
    turn = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn, -turn @ eye
    return {"width": size, "height": size, "fx": focal, "fy": focal, "cx": size / 2, "cy": size / 2, "world_to_camera": matrix.tolist()}


class Distance(unittest.TestCase):
    def test_box(self):
        points = random_points()
        for within in (0.005, 0.02, 0.1):
            near = measures.is_near(points, box(), within)
            np.testing.assert_array_equal(near, np.abs(box_distance(points)) <= within)
            np.testing.assert_array_equal(near, measures.is_near(points, measures.split(box(), 0.3), within))

    def test_sphere(self):
        points = random_points()
        distance = np.abs(np.linalg.norm(points, axis=1) - RADIUS)
        near = measures.is_near(points, sphere(), 0.02)
        self.assertTrue(near[distance < 0.02 - SLACK].all())
        self.assertFalse(near[distance > 0.02 + SLACK].any())

    def test_every_pair_at_once_or_in_turn(self):
        points, triangles = random_points(300), box()
        low, high = triangles.min(1), triangles.max(1)
        all_at_once = list(zip(*(np.concatenate(x) for x in zip(*measures.pairs(points, low, high, 0.2)))))
        in_turn = list(zip(*(np.concatenate(x) for x in zip(*measures.pairs(points, low, high, 0.2, 7)))))
        self.assertEqual(all_at_once, in_turn)
        self.assertEqual(len(set(all_at_once)), len(all_at_once))


class Sign(unittest.TestCase):
    def test_box(self):
        points = random_points()
        np.testing.assert_array_equal(measures.winding(points, box()), box_distance(points) < 0)

    def test_hollow_with_a_solid_in_it(self):
        points = random_points()
        hollow = box()[:, ::-1] * 2
        np.testing.assert_array_equal(measures.winding(points, np.concatenate([hollow, box()])),
                                      (box_distance(points) < 0).astype(int) - (box_distance(points / 2) < 0))

    def test_sphere(self):
        points = random_points()
        radius = np.linalg.norm(points, axis=1)
        sure = np.abs(radius - RADIUS) > SLACK
        np.testing.assert_array_equal(measures.winding(points, sphere())[sure], (radius < RADIUS)[sure])

    def test_two_that_overlap_count_twice(self):
        points = random_points()
        both = np.concatenate([box(), box() + [0.2, 0.1, 0]])
        expected = (box_distance(points) < 0).astype(int) + (box_distance(points - [0.2, 0.1, 0]) < 0)
        np.testing.assert_array_equal(measures.winding(points, both), expected)


class Surface(unittest.TestCase):
    def test_samples_lie_on_it_evenly(self):
        points, normals = measures.sampled(box(), 20000, 3)
        np.testing.assert_allclose(box_distance(points), 0, atol=1e-12)
        np.testing.assert_allclose(box_distance(points + 1e-3 * normals), 1e-3, atol=1e-9)
        size = HIGH - LOW
        area = 2 * (size[0] * size[1] + size[1] * size[2] + size[2] * size[0])
        self.assertAlmostEqual((normals[:, 2] > 0.5).mean(), size[0] * size[1] / area, delta=0.012)

    def test_split_keeps_area_and_side(self):
        pieces = measures.split(box(), 0.11)
        normals = lambda t: np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0])
        self.assertLessEqual(np.linalg.norm(np.roll(pieces, -1, axis=1) - pieces, axis=2).max(), 0.11)
        self.assertAlmostEqual(np.linalg.norm(normals(pieces), axis=1).sum(), np.linalg.norm(normals(box()), axis=1).sum())
        np.testing.assert_array_equal(measures.winding(random_points(), pieces), measures.winding(random_points(), box()))

    def test_closed(self):
        faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
        self.assertTrue(measures.is_closed(faces))
        self.assertFalse(measures.is_closed(faces[:3]))
        self.assertFalse(measures.is_closed(np.concatenate([faces[:3], faces[3:, ::-1]])))
        self.assertFalse(measures.is_closed(np.concatenate([faces, faces])))

    def test_file(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "m.ply"
            path.write_bytes(b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty double x\nproperty double y\n"
                             b"property double z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n" +
                             struct.pack("<9dB3i", *range(9), 3, 2, 0, 1))
            vertices, faces = measures.read_ply(path)
        np.testing.assert_array_equal(vertices, np.arange(9).reshape(3, 3))
        np.testing.assert_array_equal(faces, [[2, 0, 1]])


class View(unittest.TestCase):
    EYE = np.array([0, -3, 0.5])

    def test_front_of_a_box_hides_what_is_behind(self):
        wall = meshes.box((-2, 2, -2), (2, 2.1, 2))[0]
        triangles = measures.split(np.concatenate([box(), wall]), 0.2)
        points, normals = measures.sampled(np.concatenate([box(), wall]), 20000, 4)
        seen = measures.seen_by(camera(self.EYE), points, normals, triangles)
        is_box = points[:, 1] < 1.5
        np.testing.assert_array_equal(seen[is_box], (normals[:, 1] < -0.5)[is_box])  # the eye is level with it and before it
        away = points - self.EYE
        where = self.EYE + away * ((LOW[1] - self.EYE[1]) / away[:, 1])[:, None]
        free = ((where[:, [0, 2]] < LOW[[0, 2]]) | (where[:, [0, 2]] > HIGH[[0, 2]])).any(1)
        free &= (np.abs(away[:, [0, 2]]) < away[:, 1:2]).all(1) & (normals[:, 1] < -0.5)
        np.testing.assert_array_equal(seen[~is_box], free[~is_box])

    def test_picture_of_a_sphere(self):
        image = measures.picture_of(sphere() + [0, 0, 0.5], camera(self.EYE))
        outline = 100 * RADIUS / np.sqrt(9 - RADIUS**2)
        y, x = np.mgrid[:200, :200] + 0.5
        radius = np.hypot(x - 100, y - 100)
        is_white = (image == 1).all(2)
        self.assertFalse(is_white[radius < outline - 0.1].any())
        self.assertTrue(is_white[radius > outline + 0.1].all())
        self.assertGreater(image[85, 90, 0], image[115, 110, 0])  # lit from the upper left


class Truth(unittest.TestCase):
    """A closed surface has the same winding by a ray of any direction."""

    def check_closed(self, parts, low, high):
        """And its mean is the volume of all solids, less that of the hollow."""
        triangles = meshes.all_triangles(parts)
        points = np.random.default_rng(5).uniform(low, high, (10000, 3))
        up = measures.winding(points, triangles)
        for turn in ([1, 2, 0], [2, 0, 1]):
            few = points[:2000, turn]
            np.testing.assert_array_equal(up[:2000], measures.winding(few, triangles[..., turn]))
        volume = np.linalg.det(triangles).sum() / 6
        whole = np.prod(np.subtract(high, low))
        self.assertAlmostEqual(up.mean() * whole, volume, delta=4 * whole * up.std() / np.sqrt(len(up)))
        return points, up

    def test_room(self):
        points, winding = self.check_closed(meshes.room(), meshes.LOW - 0.3, meshes.HIGH + 0.3)
        is_inside = ((points > meshes.LOW) & (points < meshes.HIGH)).all(1)
        self.assertTrue((winding[is_inside] >= -1).all())
        self.assertGreater((winding[is_inside] == -1).mean(), 0.85)  # most of a room is free
        self.assertLess((winding[is_inside] == -1).mean(), 0.98)
        one = lambda *point: measures.winding(np.array([point], float), meshes.all_triangles(meshes.room()))[0]
        self.assertEqual(one(-1.3, 2.03, 1.5), -1)  # the window's recess
        self.assertGreater(one(-1.3, 2.3, 1.5), -1)
        self.assertGreater(one(0.95, -0.25, 0.73), -1)  # the table's top
        self.assertEqual(one(0.95, -0.25, 0.30), -1)  # below it

    def test_jug_and_box(self):
        parts = meshes.jug_and_box()
        points, winding = self.check_closed(parts, (-0.25, -0.15, -0.05), (0.25, 0.15, 0.3))
        self.assertTrue(set(np.unique(winding)) <= {0, 1, 2})
        jug = parts[0].triangles.reshape(-1, 3)
        middle = (jug.min(0) + jug.max(0)) / 2
        self.assertEqual(measures.winding(middle[None], meshes.all_triangles(parts))[0], 0)  # it is open

    def test_file(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "m.glb"
            meshes.write_glb(path, meshes.jug_and_box())
            data = path.read_bytes()
        length, = struct.unpack_from("<I", data, 12)
        table = json.loads(data[20:20 + length])
        self.assertEqual(struct.unpack_from("<I", data, 8)[0], len(data))
        corners = sum(table["accessors"][p["attributes"]["POSITION"]]["count"] for p in table["meshes"][0]["primitives"])
        self.assertEqual(corners, 3 * len(meshes.all_triangles(meshes.jug_and_box())))


unittest.main()
