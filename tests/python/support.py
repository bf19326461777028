"""What the tests of the Python module share: a tiny dataset, and Gaussians at random."""

import atexit
import json
import os
import pathlib
import shutil
import subprocess
import tempfile

import numpy as np

import hsi4d

PROGRAM = os.environ["HSI4D_PROGRAM"]
SOURCE = pathlib.Path(__file__).resolve().parents[2]

STAGES = {
    "camera": {
        "iterations": 8, "draw": "scene", "weight": "unoccluded",
        "optimize": {"camera": {"lr": 0.004, "lr_final_share": 0.1}},
        "losses": {"masked_l2": {}},
    },
    "interaction": {
        "iterations": 10,
        "optimize": {name: {"lr": 0.01, "lr_final_share": 0.05}
                     for name in ["transl", "global_orient", "body_pose", "object_orient", "object_transl"]},
        "losses": {"photometric": {"ssim_share": 0.1}, "center": {"weight": 0.001}, "depth": {"weight": 0.1}},
    },
}

_base = None


def scratch():
    """A folder that is removed when the tests end."""
    global _base
    if _base is None:
        _base = pathlib.Path(tempfile.mkdtemp(prefix="hsi4d_python_"))
        atexit.register(shutil.rmtree, _base, ignore_errors=True)
    return pathlib.Path(tempfile.mkdtemp(dir=_base))


def program(*words):
    """Runs hsi4d; returns what it prints."""
    return subprocess.run([PROGRAM, *map(str, words)], check=True, capture_output=True, text=True).stdout


_dataset = None


def dataset():
    """The config of a dataset of 4 frames of 48 x 48 pixels, made once."""
    global _dataset
    if _dataset is None:
        folder = scratch()
        config = {
            "name": "tiny",
            "synthetic": {"frames": 4, "size_px": 48, "video": "png", "scene_gaussians": 1500,
                          "avatar_gaussians": 500, "object_gaussians": 150},
            "render": {"blur": 0.13},
            "stages": STAGES,
        }
        (folder / "tiny.json").write_text(json.dumps(config))
        program("synth", folder / "tiny.json", "--out", folder / "data")
        _dataset = folder / "data" / "config.json"
    return _dataset


def config(overrides=None):
    return hsi4d.load_config(dataset(), overrides)


def config_with(stages, overrides=None):
    """The config with more in its stages: what overrides cannot add."""
    return hsi4d.make_config({"extends": "config.json", "stages": stages}, dataset().parent, overrides)


def config_with_loss(stage, name, overrides=None):
    return config_with({stage: {"losses": {name: {}}}}, overrides)


def random_gaussians(count, seed=1, coefficients=4):
    """Gaussians within a metre of the origin."""
    random = np.random.default_rng(seed)
    return hsi4d.Gaussians(
        random.uniform(-1, 1, (count, 3)), random.normal(size=(count, 4)), random.uniform(-2.5, -1.5, (count, 3)),
        random.uniform(-1, 2, count), random.uniform(-0.4, 0.8, (count, coefficients, 3)))


def camera(width=40, height=32):
    """A camera at (0.2, -3, 0.4) that looks at the origin."""
    return hsi4d.Camera(width, height, 1.1 * width, 1.12 * width, 0.5 * width, 0.5 * height,
                        hsi4d.look_at((0.2, -3, 0.4), (0, 0, 0)))
