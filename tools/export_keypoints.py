#!/usr/bin/env python3
"""Turns what SAM 3D Body finds in the frames of a video into keypoints that hsi4d reads (data.keypoints), with places in space.

    tools/export_keypoints.py people.npz keypoints.json       # arrays of one person
    tools/export_keypoints.py people.pkl keypoints.json       # what its estimator returned, frame by frame
    tools/export_keypoints.py people.npy keypoints.json --size 1280,720 --person 1

SAM 3D Body (facebookresearch/sam-3d-body) returns, of a picture, a list of people, and saves nothing by itself. Read are

| file   | made by                                                                                                     |
|--------|-------------------------------------------------------------------------------------------------------------|
| `.pkl` | `pickle.dump([estimator.process_one_image(f) for f in frames], file)`                                       |
| `.npy` | `numpy.save(file, numpy.array([...], dtype=object))` of the same list                                       |
| `.npz` | `numpy.savez(file, pred_keypoints_2d=..., pred_keypoints_3d=...)` of one person, [T,70,2] and [T,70,3]      |

Of a person `pred_keypoints_2d` [70,2], pixels of the picture, and `pred_keypoints_3d` [70,3], metres in the camera's axes (x
right, y down, z away), are used, in the order of MHR's 70 points: 44 of them are joints of SMPL-X, hands included. The person
is the --person'th of the first frame that shows somebody, by size of the box in the picture from 0, and then whoever is nearest.
SAM 3D Body says of no point how sure it is: all have confidence 1, in frames in which it found somebody.

`hsi4d run` finds a motion of SMPL-X from such keypoints ("sources": {"motion": {"program": "embedded"}}), and any stage may use
them (losses keypoints_2d and bone_directions). MHR's own parameters are not read: their numbers mean nothing to another body.

Needs Python with NumPy. Of a pickle only arrays, lists and tables are read, which runs no code; anything else is refused.
"""

import argparse
import json
import pathlib
import pickle
import sys

POINTS = 70
FINGERS = ("thumb", "index", "middle", "ring", "pinky")
TWO_D, THREE_D = "pred_keypoints_2d", "pred_keypoints_3d"


def hand(side):
    """Four points a finger, from the tip to the palm; SMPL-X counts joints from the palm."""
    return [joint for finger in FINGERS for joint in (None, *(f"{side}_{finger}{k}" for k in (3, 2, 1)))]


# By point, the joint of SMPL-X that it stands for.  [facebookresearch/sam-3d-body, metadata of MHR's 70 keypoints]
JOINTS = [None, "left_eye_smplhf", "right_eye_smplhf", None, None,
          "left_shoulder", "right_shoulder", "left_elbow", "right_elbow", "left_hip", "right_hip", "left_knee", "right_knee",
          "left_ankle", "right_ankle", *[None] * 6,
          *hand("right"), "right_wrist", *hand("left"), "left_wrist", *[None] * 7]
assert len(JOINTS) == POINTS


def fail(message):
    sys.exit("export_keypoints: " + message)


class ArraysAlone(pickle.Unpickler):
    """Numbers, texts and arrays of NumPy in tables and lists."""

    KNOWN = {"_reconstruct", "ndarray", "dtype", "scalar", "_frombuffer", "OrderedDict", "encode"}
    HOMES = ("numpy", "numpy.core.multiarray", "numpy._core.multiarray", "numpy.core.numeric", "numpy._core.numeric",
             "collections", "_codecs")

    def find_class(self, home, name):
        if home not in self.HOMES or name not in self.KNOWN:
            raise pickle.UnpicklingError(f"holds {home}.{name}, which is no array and is not unpickled")
        return super().find_class(home, name)


def unpickled(path, file):
    try:
        return ArraysAlone(file).load()
    except Exception as problem:  # a damaged pickle fails in any way
        fail(f"{path}: {problem}")


def listed(np, path):
    """Frames, each a list of people."""
    with open(path, "rb") as file:
        if path.suffix == ".npy":
            if file.read(6) != b"\x93NUMPY":
                fail(f"{path}: is no .npy")
            file.seek(0)
            major = np.lib.format.read_magic(file)[0]
            shape, _, kind = (np.lib.format.read_array_header_1_0 if major == 1 else np.lib.format.read_array_header_2_0)(file)
            if kind != object:
                fail(f"{path}: holds numbers; allowed: lists of what the estimator returned, or a .npz of one person's arrays")
        frames = unpickled(path, file)
    frames = frames.tolist() if hasattr(frames, "tolist") else frames
    if not isinstance(frames, list) or not frames:
        fail(f"{path}: holds no list of frames")
    return frames


def points_of(np, value, columns, what):
    try:
        points = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        fail(f"{what}: holds no numbers")
    if points.shape != (POINTS, columns):
        fail(f"{what}: has the shape {list(points.shape)}; allowed: [{POINTS}, {columns}]")
    if not np.isfinite(points).all():
        fail(f"{what}: holds a number that is not finite")
    return points


def people_of(np, frame, what):
    """Pairs of arrays, the largest box first."""
    frame = frame.tolist() if hasattr(frame, "tolist") else frame
    if not isinstance(frame, list):
        fail(f"{what}: is no list of people")
    people = []
    for i, person in enumerate(frame):
        where = f"{what}, person {i}"
        for key in (TWO_D, THREE_D):
            if not isinstance(person, dict) or key not in person:
                fail(f"{where}: has no {key}")
        people.append((points_of(np, person[TWO_D], 2, f"{where}: {TWO_D}"),
                       points_of(np, person[THREE_D], 3, f"{where}: {THREE_D}")))
    return sorted(people, key=lambda person: -np.prod(np.ptp(person[0], axis=0)))


def followed(np, frames, which, path):
    """One person a frame, or None."""
    last, person = None, []
    for people in frames:
        if not people:
            person.append(None)
            continue
        if last is None:
            if which >= len(people):
                fail(f"--person: {which}; {path} shows {len(people)} at first; allowed: 0 to {len(people) - 1}")
            chosen = people[which]
        else:
            chosen = min(people, key=lambda other: np.linalg.norm(other[0] - last, axis=1).mean())
        last = chosen[0]
        person.append(chosen)
    if last is None:
        fail(f"{path}: shows nobody in any frame")
    return person


def read(np, path, which):
    if path.suffix != ".npz":
        frames = [people_of(np, frame, f"{path}: frame {t}") for t, frame in enumerate(listed(np, path))]
        return followed(np, frames, which, path)
    with np.load(path) as file:  # without pickles
        for key in (TWO_D, THREE_D):
            if key not in file:
                fail(f"{path}: has no array {key}; it has {', '.join(sorted(file)) or 'none'}")
        flat, deep = file[TWO_D], file[THREE_D]
    if flat.ndim != 3 or deep.ndim != 3 or len(flat) != len(deep) or len(flat) == 0:
        fail(f"{path}: {TWO_D} has the shape {list(flat.shape)}, {THREE_D} {list(deep.shape)}; allowed: [T, 70, 2] and [T, 70, 3]")
    return [(points_of(np, flat[t], 2, f"{path}: {TWO_D}, frame {t}"), points_of(np, deep[t], 3, f"{path}: {THREE_D}, frame {t}"))
            for t in range(len(flat))]


def size_of(text):
    try:
        width, height = (int(part) for part in text.split(","))
    except ValueError:
        fail(f"--size: {text!r}; allowed: WIDTH,HEIGHT, pixels")
    if width < 1 or height < 1:
        fail(f"--size: {text!r}; allowed: at least 1,1")
    return [width, height]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("input", type=pathlib.Path, metavar="IN", help=".pkl, .npy or .npz")
    parser.add_argument("out", type=pathlib.Path, metavar="OUT.json")
    parser.add_argument("--person", type=int, default=0, metavar="N", help="of the first frame, by size from 0")
    parser.add_argument("--size", metavar="W,H", help="of the pictures that were searched, if not the video's frames")
    arguments = parser.parse_args()
    try:
        import numpy as np
    except ImportError:
        fail("Python's module numpy is not there")
    if arguments.input.suffix not in (".pkl", ".npy", ".npz"):
        fail(f"{arguments.input}: allowed: .pkl, .npy, .npz")
    if arguments.person < 0:
        fail(f"--person: {arguments.person}; allowed: 0 or more")
    try:
        person = read(np, arguments.input, arguments.person)
    except (OSError, ValueError) as problem:
        fail(f"{arguments.input}: {problem}")
    rows = lambda points: [[round(float(x), 5) for x in point] for point in points]  # noqa: E731
    content = {"format": "hsi4d keypoints", "version": 1, "joints": JOINTS}
    if arguments.size:
        content["size"] = size_of(arguments.size)
    content["frames"] = [[] if one is None else [[*point, 1] for point in rows(one[0])] for one in person]
    content["landmarks"] = [[] if one is None else rows(one[1]) for one in person]
    made = arguments.out.with_name(arguments.out.name + ".tmp")
    made.write_text(json.dumps(content) + "\n")
    made.rename(arguments.out)
    nobody = sum(one is None for one in person)
    print(f"{arguments.out}: {len(person)} frames" + (f", {nobody} of them of nobody" if nobody else ""))


if __name__ == "__main__":
    main()
