"""tools/train_pose_prior on made motions, and what the network in its file makes of them."""

import subprocess
import sys
import unittest

import numpy as np

import hsi4d
from support import SOURCE, scratch

TOOL = SOURCE / "tools/train_pose_prior"


def train(*words):
    return subprocess.run([sys.executable, TOOL, *map(str, words)], capture_output=True, text=True)


def swinging(frames, seed):
    """[frames,55,3]: an arm and a leg that swing, each about an axis of its own."""
    random = np.random.default_rng(seed)
    rotations = np.zeros((frames, 55, 3))
    for joint in (1, 4, 16, 18):
        axis = random.standard_normal(3) / 2
        rotations[:, joint] = np.sin(np.linspace(0, 5, frames) + joint)[:, None] * axis
    return rotations


def layer(arrays, name, x):
    return x @ arrays[name + ".weight"].T + arrays[name + ".bias"]


def normalized(arrays, name, x):
    spread = np.sqrt(arrays[name + ".running_var"] + 1e-5)
    return (x - arrays[name + ".running_mean"]) / spread * arrays[name + ".weight"] + arrays[name + ".bias"]


def leaky(x):
    return np.where(x > 0, x, 0.01 * x)


def first_columns(arrays, poses):
    """[N,21,3], the first columns of the rotations that the network as published makes of [N,63]."""
    x = leaky(layer(arrays, "encoder_net.2", normalized(arrays, "encoder_net.1", poses)))
    x = layer(arrays, "encoder_net.6", normalized(arrays, "encoder_net.4", x))
    z = layer(arrays, "encoder_net.8.mu", layer(arrays, "encoder_net.7", x))
    x = leaky(layer(arrays, "decoder_net.3", leaky(layer(arrays, "decoder_net.0", z))))
    a = layer(arrays, "decoder_net.5", x).reshape(len(poses), 21, 3, 2)[..., 0]
    return a / np.linalg.norm(a, axis=-1, keepdims=True)


def turned_x(w):
    """[..,3] the first columns of rotations by axis-angle vectors, by Rodrigues' formula."""
    angle = np.maximum(np.linalg.norm(w, axis=-1, keepdims=True), 1e-12)
    k, x = w / angle, np.array([1.0, 0, 0])
    return x * np.cos(angle) + np.cross(k, x) * np.sin(angle) + k * k[..., :1] * (1 - np.cos(angle))


class TrainPosePrior(unittest.TestCase):
    def test_motions_of_ones_own(self):
        folder = scratch()
        (folder / "motions").mkdir()
        for seed in range(2):
            hsi4d.write_motion(folder / f"motions/{seed}.npz", hsi4d.Motion(np.zeros((80, 3)), swinging(80, seed)))
        done = train(folder / "p.npz", "--motions", folder / "motions", "--latents", 12)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertRegex(done.stdout, r"its own motions: poses are met to \d+\.\d mm; disturbed ones are off by")
        self.assertRegex(done.stdout, r"motions of kinds that it does not know: ")
        arrays = dict(np.load(folder / "p.npz"))
        self.assertEqual(arrays["decoder_net.0.weight"].shape, (24, 12))
        poses = swinging(80, 0)[:, 1:22]
        found = first_columns(arrays, poses.reshape(80, 63))
        off = np.degrees(np.arccos(np.clip((found * turned_x(poses)).sum(-1), -1, 1)))
        self.assertLess(off.mean(), 4)
        train(folder / "q.npz", "--motions", folder / "motions", "--latents", 12)
        self.assertEqual((folder / "p.npz").read_bytes(), (folder / "q.npz").read_bytes())

    def test_bad_input(self):
        folder = scratch()
        for words, message in (((folder / "p.npz", "--motions", folder), "holds no motions (.npz)"),
                               ((folder / "p.pt", "--motions", folder), "allowed ending: .npz"),
                               ((folder / "p.npz", "--latents", 0), "--latents: 0; allowed: 1 to 126")):
            done = train(*words)
            self.assertEqual(done.returncode, 1)
            self.assertIn(message, done.stderr)


if __name__ == "__main__":
    unittest.main()
