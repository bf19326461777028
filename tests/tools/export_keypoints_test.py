"""tools/export_keypoints.py on made files, and that hsi4d reads what it writes.

    python3 tests/tools/export_keypoints_test.py TOOLS HSI4D
"""

import json
import os
import pathlib
import pickle
import subprocess
import sys
import tempfile

try:
    import numpy as np
except ImportError:
    print("skipped: Python has no NumPy")
    sys.exit(77)

tool, program = pathlib.Path(sys.argv[1]).resolve() / "export_keypoints.py", pathlib.Path(sys.argv[2]).resolve()
rng = np.random.default_rng(3)


def person(x, size):
    """Somebody whose points are about x, in a box of that size."""
    flat = np.float32([x, 30]) + np.float32(rng.uniform(-size / 2, size / 2, (70, 2)))
    return {"pred_keypoints_2d": flat, "pred_keypoints_3d": np.float32(rng.normal(0, 0.3, (70, 3))), "focal_length": np.float32(900),
            "mask": None}


def run(*arguments):
    return subprocess.run([sys.executable, "-B", tool, *map(str, arguments)], capture_output=True, text=True)


def export(*arguments):
    result = run(*arguments)
    assert result.returncode == 0, result.stderr
    return result.stdout


def refused(words, *arguments):
    result = run(*arguments)
    assert result.returncode == 1 and words in result.stderr and "Traceback" not in result.stderr, result.stderr


def close(a, b):
    assert np.abs(np.asarray(a) - b).max() < 1e-5


with tempfile.TemporaryDirectory() as folder:
    os.chdir(folder)
    small, large = [person(20 + t, 8) for t in range(4)], [person(60 - t, 20) for t in range(4)]
    frames = [[small[0], large[0]], [], [large[2], small[2]], [small[3], large[3]]]
    pickle.dump(frames, open("people.pkl", "wb"))
    listed = np.empty(4, dtype=object)
    listed[:] = frames
    np.save("people.npy", listed, allow_pickle=True)
    np.savez("one.npz", **{key: np.stack([p[key] for p in large]) for key in ("pred_keypoints_2d", "pred_keypoints_3d")})

    # The largest person first; then whoever is nearest, whatever the order.
    assert "4 frames, 1 of them of nobody" in export("people.pkl", "a.json", "--size", "100,50")
    found = json.load(open("a.json"))
    assert (found["format"], found["version"], found["size"]) == ("hsi4d keypoints", 1, [100, 50])
    assert len(found["joints"]) == 70 and sum(joint is not None for joint in found["joints"]) == 44, found["joints"]
    at = found["joints"].index
    assert (at("left_wrist"), at("right_wrist"), at("left_ankle")) == (62, 41, 13)
    assert (at("right_thumb1"), at("right_thumb3"), at("left_index1"), at("left_pinky3")) == (24, 22, 49, 59)
    assert found["frames"][1] == [] and found["landmarks"][1] == []
    for t in (0, 2, 3):
        close(np.asarray(found["frames"][t])[:, :2], large[t]["pred_keypoints_2d"])
        close(found["landmarks"][t], large[t]["pred_keypoints_3d"])
        assert {point[2] for point in found["frames"][t]} == {1}
    export("people.npy", "b.json", "--person", 1)
    other = json.load(open("b.json"))
    assert "size" not in other
    close(np.asarray(other["frames"][2])[:, :2], small[2]["pred_keypoints_2d"])
    export("one.npz", "c.json")
    assert json.load(open("c.json"))["frames"][3] == found["frames"][3]

    # hsi4d reads it.
    synthetic = {"frames": 4, "size_px": 48, "video": "png", "scene_gaussians": 1000, "avatar_gaussians": 300, "object_gaussians": 100}
    stages = {"pose": {"iterations": 2, "optimize": {"body_pose": {"lr": 0.01}},
                       "losses": {"keypoints_2d": {}, "bone_directions": {}}}}
    json.dump({"synthetic": synthetic, "stages": stages}, open("s.json", "w"))
    for command in (["synth", "s.json", "--out", "clip"],
                    ["run", "clip/config.json", "--set", "data.keypoints=c.json", "--dry-run"]):
        done = subprocess.run([program, *command], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr

    # Bad input.
    refused("--person: 2; people.pkl shows 2 at first; allowed: 0 to 1", "people.pkl", "x.json", "--person", 2)
    refused("--size: '12'; allowed: WIDTH,HEIGHT", "people.pkl", "x.json", "--size", "12")
    refused("x.mat: allowed: .pkl, .npy, .npz", "x.mat", "x.json")
    refused("none.pkl", "none.pkl", "x.json")
    pickle.dump([[]], open("empty.pkl", "wb"))
    refused("shows nobody in any frame", "empty.pkl", "x.json")
    pickle.dump([[{"pred_keypoints_2d": np.zeros((70, 2))}]], open("half.pkl", "wb"))
    refused("frame 0, person 0: has no pred_keypoints_3d", "half.pkl", "x.json")
    pickle.dump([[{"pred_keypoints_2d": np.zeros((17, 2)), "pred_keypoints_3d": np.zeros((70, 3))}]], open("few.pkl", "wb"))
    refused("pred_keypoints_2d: has the shape [17, 2]; allowed: [70, 2]", "few.pkl", "x.json")
    bad = person(0, 1)
    bad["pred_keypoints_3d"][3, 1] = np.nan
    pickle.dump([[bad]], open("nan.pkl", "wb"))
    refused("pred_keypoints_3d: holds a number that is not finite", "nan.pkl", "x.json")
    pickle.dump([[pathlib.Path("x")]], open("code.pkl", "wb"))
    refused("which is no array and is not unpickled", "code.pkl", "x.json")
    open("cut.pkl", "wb").write(open("people.pkl", "rb").read()[:200])
    refused("cut.pkl", "cut.pkl", "x.json")
    np.save("numbers.npy", np.zeros(3))
    refused("holds numbers; allowed: lists of what the estimator returned", "numbers.npy", "x.json")
    np.savez("other.npz", a=np.zeros(3))
    refused("has no array pred_keypoints_2d; it has a", "other.npz", "x.json")
    assert not list(pathlib.Path(".").glob("*.tmp")) and not pathlib.Path("x.json").exists()
print("ok")
