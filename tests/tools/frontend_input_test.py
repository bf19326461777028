"""What tools/frontend and tools/from_video say where something is missing or wrong, without a browser.

    python3 tests/tools/frontend_input_test.py TOOLS      # the folder tools/
"""

import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

tools = pathlib.Path(sys.argv[1]).resolve()

# What the scripts call beside Node and Chromium.
needed = ["bash", "env", "dirname", "head", "sed", "mkdir", "mktemp", "rm", "mv", "grep"]


def run(*words, env=None):
    """What it says; it has to fail."""
    result = subprocess.run([str(word) for word in words], capture_output=True, text=True, env=env)
    assert result.returncode == 1, f"exit status {result.returncode}: {result.stdout}{result.stderr}"
    return result.stdout + result.stderr


def path_with(folder, programs):
    """A PATH with these programs alone; those that are not on this machine are stand-ins that do nothing."""
    folder.mkdir()
    for name in needed + programs:
        there = shutil.which(name)
        if there:
            (folder / name).symlink_to(there)
        else:
            (folder / name).write_text("#!/bin/sh\n")
            (folder / name).chmod(0o755)
    return dict(os.environ, PATH=str(folder), CHROMIUM="")


def run_node(script):
    result = subprocess.run(["node", "--input-type=module", "-e", script], capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr


# A person of 100 px to a metre, whose left wrist is at (50, 80), the roots of the fingers 8 px to the right of it.
HANDS = """
import assert from 'node:assert';
import { squareOf, handIn } from '%s';
const left = { wrist: 0, fingers: [1, 2, 3] };
const places = [[0.5, 0.8, 0.1], [0.58, 0.8, 0.1], [0.58, 0.78, 0.1], [0.58, 0.82, 0.1], [0, 0, 0], [0, 1, 0]];
const points = places.map(([x, y]) => [100 * x, 100 * y, 0.5]);
const square = squareOf(left, points, places);
assert(Math.abs(square.x - 58) < 1e-9 && Math.abs(square.y - 80) < 1e-9 && Math.abs(square.side - 45) < 1e-9);
const hand = (x, y, score) => ({ score, points: Array(21).fill({ x, y, z: 0 }), places: Array(21).fill({ x, y, z: 0.01 }) });
const own = [0.5 - 8 / 45, 0.5]; // where BlazePose's wrist is in the square
const near = handIn(square, [hand(own[0] + 0.2, 0.5, 1), hand(...own, 0.8)], points[0], places[0]);
assert(near.points.length === 21 && near.places.length === 21);
assert(Math.abs(near.points[0][0] - 50) < 1e-9 && Math.abs(near.points[0][1] - 80) < 1e-9);
assert(Math.abs(near.points[20][2] - 0.4) < 1e-9); // score times visibility
assert.deepStrictEqual(near.places[0], places[0]);
const far = handIn(square, [hand(own[0] + 0.3, 0.5, 1)], points[0], places[0]);
assert.deepStrictEqual(far.points[7], [50, 80, 0]);
assert.strictEqual(far.places.length, 21);
"""

with tempfile.TemporaryDirectory() as name:
    here = pathlib.Path(name)
    video = here / "video.mp4"
    video.write_text("no video")
    frontend = [tools / "frontend", video, "--out", here / "found", "--packages", here / "packages"]
    assert "there is no node, and it cannot be installed (Debian package nodejs)" in run(*frontend, env=path_with(here / "a", ["ffmpeg"]))
    assert "there is no ffmpeg, and it cannot be installed (Debian package ffmpeg)" in run(*frontend, env=path_with(here / "b", ["node"]))
    said = run(*frontend, env=path_with(here / "c", ["node", "ffmpeg"]))
    assert "there is no Chromium, and it cannot be installed (Debian package chromium)" in said, said

    # A package that is not whole.
    pose = here / "packages/node_modules/@mediapipe/pose"
    pose.mkdir(parents=True)
    (here / "packages/node_modules/playwright-core").mkdir()
    for file in ["pose.js", "pose_landmark_full.tflite", "pose_web.binarypb", "pose_solution_packed_assets.data"]:
        (pose / file).write_text("something")
    whole = path_with(here / "d", ["node", "ffmpeg", "chromium"])
    said = run(*frontend, "--model", "heavy", env=whole)
    assert "pose_landmark_heavy.tflite is missing; remove " in said and "--install" in said, said
    (pose / "pose_web.binarypb").write_text("")
    assert "pose_web.binarypb is missing" in run(*frontend, env=whole)
    (pose / "pose_web.binarypb").write_text("something")
    hands = here / "packages/node_modules/@mediapipe/hands"
    hands.mkdir()
    for file in ["hands.js", "hands.binarypb", "hands_solution_packed_assets.data"]:
        (hands / file).write_text("something")
    said = run(*frontend, "--hands", env=whole)
    assert "hands/hand_landmark_full.tflite is missing; remove " in said and "--hands" in said, said
    assert not (here / "found").exists()

    # A hand is that at BlazePose's wrist, in pixels of the frame.
    if shutil.which("node"):
        run_node(HANDS % (tools / "services/hands.mjs").as_uri())

    assert "allowed: lite, full, heavy" in run(*frontend, "--model", "best")
    assert "allowed: X0,Y0,X1,Y1, whole pixels of the first frame" in run(*frontend, "--person", "1,2,3")
    assert "there is no such file" in run(tools / "frontend", here / "none.mp4", "--out", here / "x")
    from_video = [tools / "from_video", video, "--out", here / "x"]
    assert "--fov needs --scene" in run(*from_video, "--fov", "60")
    assert "there is no option --gues" in run(*from_video, "--gues", "60")
    in_scene = [*from_video, "--scene", video]
    assert "where is the camera of frame 0 in it?" in run(*in_scene)
    assert "both say where the camera is" in run(*in_scene, "--guess", video, "--camera", video)
    assert "none.json: there is no such file" in run(*in_scene, "--guess", here / "none.json")
    assert "allowed: learnt, kept" in run(*from_video, "--look", "found")
    assert "a video and --out DIR are needed" in run(tools / "from_video", video)
    assert "is there and no folder" in run(tools / "from_video", video, "--out", video)
    assert "tools/frontend makes them" in run(*from_video, "--masks", here)
    assert "there is no such file" in run(tools / "from_video", here / "none.mp4", "--out", here / "x")
    assert not (here / "x").exists()

    # A folder of another video or of other options is no place for this one.
    (here / "y").mkdir()
    (here / "y/made_of.txt").write_text("another video\n")
    said = run(tools / "from_video", video, "--out", here / "y")
    assert "was made of another video or with other options" in said and "name a new folder" in said, said
    (here / "y/made_of.txt").unlink()
    (here / "y/found").mkdir()
    assert "no made_of.txt says of what" in run(tools / "from_video", video, "--out", here / "y")
print("passed")
