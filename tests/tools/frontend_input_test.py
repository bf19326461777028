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


with tempfile.TemporaryDirectory() as name:
    here = pathlib.Path(name)
    video = here / "video.mp4"
    video.write_text("no video")
    frontend = [tools / "frontend", video, "--out", here / "found", "--packages", here / "packages"]
    assert "there is no node (Debian package nodejs)" in run(*frontend, env=path_with(here / "a", ["ffmpeg"]))
    assert "there is no ffmpeg (Debian package ffmpeg)" in run(*frontend, env=path_with(here / "b", ["node"]))
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
    assert not (here / "found").exists()

    assert "allowed: lite, full, heavy" in run(*frontend, "--model", "best")
    assert "allowed: X0,Y0,X1,Y1, whole pixels of the first frame" in run(*frontend, "--person", "1,2,3")
    assert "there is no such file" in run(tools / "frontend", here / "none.mp4", "--out", here / "x")
    from_video = [tools / "from_video", video, "--out", here / "x"]
    assert "allowed: learnt, kept" in run(*from_video, "--look", "found")
    assert "tools/frontend makes them" in run(*from_video, "--masks", here)
    assert "there is no such file" in run(tools / "from_video", here / "none.mp4", "--out", here / "x")
    assert not (here / "x").exists()
print("passed")
