"""tools/frontend on a generated clip: a person is found where the truth has one.

    python3 tests/tools/frontend_test.py TOOLS HSI4D PACKAGES      # the folder tools/, the program, where npm's packages are

Exit status 77 (skipped) where the packages or Chromium are missing: tools/frontend --install installs them.
"""

import json
import math
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

tools, program, packages = (pathlib.Path(word).resolve() for word in sys.argv[1:4])
if not (packages / "node_modules/@mediapipe/pose/pose.js").exists() or not shutil.which("chromium"):
    print("skipped: there is no BlazePose or no Chromium; tools/frontend --install installs them")
    sys.exit(77)


def run(*words, status=0, env=None):
    result = subprocess.run([str(word) for word in words], capture_output=True, text=True, env=env)
    assert result.returncode == status, result.stdout + result.stderr
    return result.stdout + result.stderr


with tempfile.TemporaryDirectory() as name:
    here = pathlib.Path(name)
    config = tools.parent / "configs/synthetic/clips/terrace_walk_box.json"
    clip = here / "clip"
    run(program, "synth", config, "--out", clip, "--quiet", "--set", "synthetic.frames=3")
    frontend = [tools / "frontend", "--packages", packages]
    said = run(*frontend, clip / "video.mp4", "--out", here / "found")
    found = json.loads((here / "found/keypoints.json").read_text())
    assert found["joints"] == "blazepose33" and len(found["frames"]) == 3 and found["size"] == [512, 512], said
    assert all(len(frame) == 33 for frame in found["frames"])
    masks = sorted(path.name for path in (here / "found/masks/human").iterdir())
    assert masks == ["0000.png", "0001.png", "0002.png"], masks
    landmarks = json.loads((here / "found/keypoints.json").read_text())["landmarks"]
    assert len(landmarks) == 3 and len(landmarks[0]) == 33
    assert len(found["scores"]) == 3 and all(0.5 < score <= 1 for score in found["scores"]), found["scores"]
    assert f"frontend: the score is {min(found['scores']):g} to {max(found['scores']):g}, below 0.5 in 0 of 3 frames" in said, said

    # The program reads them, and the term that does ends near them: the points are the person's.
    stages = json.loads((clip / "config.json").read_text())["stages"]
    losses = {name: None for name in stages["interaction"]["losses"]}
    (here / "run.json").write_text(json.dumps({
        "extends": str(clip / "config.json"),
        "data": {"keypoints": str(here / "found/keypoints.json")},
        "stages": {"refinement": None, "camera": {"iterations": 1}, "interaction": {
            "iterations": 60,
            "optimize": {"color_net": None, "object_orient": None, "object_transl": None},
            "losses": {**losses, "keypoints_2d": {"weight": 1e-3}, "pose_prior": {}}}},
    }))
    run(program, "run", here / "run.json", "--out", here / "run", "--quiet", "--set", "remove_depth_bias=false")
    lines = [json.loads(line) for line in (here / "run/metrics.jsonl").read_text().splitlines()]
    last = [line for line in lines if line["stage"] == "interaction"][-1]["losses"]["keypoints_2d"]
    print(f"keypoints_2d at the end: {last:.1f} px^2")
    assert last < 8**2, last

    # The same inside of a run: nothing but the video, the scene and frame 0 are given.
    (here / "own.json").write_text(json.dumps({
        "extends": str(clip / "config.json"), "remove_depth_bias": False,
        "data": {"masks": ""}, "sources": {"motion": {"program": "embedded"}, "masks": {"program": "embedded"}},
        "stages": {"refinement": None, "camera": {"iterations": 1}, "interaction": {"iterations": 1}},
    }))
    environment = dict(os.environ, HSI4D_FRONTEND=str(packages))
    run(program, "run", here / "own.json", "--out", here / "own", env=environment)
    made = sorted(path.name.split("-")[0] for path in (here / "generated").iterdir())
    assert made == ["masks", "masks", "motion", "motion", "person", "person"], made
    person = next(path for path in (here / "generated").iterdir() if path.name.startswith("person-") and path.is_dir())
    # BlazePose finds the same points again to about 0.15 px.
    again = json.loads((person / "keypoints.json").read_text())["frames"]
    assert all(math.dist(a[:2], b[:2]) < 1 for one, two in zip(again, found["frames"], strict=True) for a, b in zip(one, two))

    # Hands: the one that is raised is found, at BlazePose's wrist and with its fingers in their order.
    if (packages / "node_modules/@mediapipe/hands/hands.js").exists():
        wave = here / "wave"
        run(program, "synth", tools.parent / "configs/synthetic/alone.json", "--out", wave, "--quiet", "--set",
            "synthetic.frames=8")
        said = run(*frontend, "--hands", wave / "video.mp4", "--out", here / "hands")
        hands = json.loads((here / "hands/keypoints.json").read_text())
        assert hands["joints"] == "blazepose33_hands", said
        assert all(len(frame) == 75 for part in ["frames", "landmarks"] for frame in hands[part])
        seen = [frame for frame in hands["frames"] if frame[33][2] > 0]
        assert len(seen) >= 4 and f"frontend: the left hand is found in {len(seen)} frames" in said, said
        for frame in seen:  # the root of the index finger, by both; tips are farther from the wrist
            assert math.dist(frame[19][:2], frame[33 + 5][:2]) < 20, frame
            assert math.dist(frame[33][:2], frame[33 + 12][:2]) > math.dist(frame[33][:2], frame[33 + 9][:2]), frame
    else:
        print("there is no MediaPipe Hands; tools/frontend --install --hands installs it")

    # What telephones and viewers do to a video: two persons, upright, lying with a note that it is to be turned.
    def look(name, words, source="video.mp4", options=()):
        made = here / f"{name}.mp4"
        run("ffmpeg", "-v", "error", "-i", clip / source if isinstance(source, str) else source, *words, made)
        said = run(*frontend, made, *options, "--out", here / name)
        return made, said, json.loads((here / name / "keypoints.json").read_text())

    def hips(found):
        return [(frame[23][0] + frame[24][0]) / 2 / found["size"][0] for frame in found["frames"]]

    _, said, two = look("two", ["-filter_complex", "[0:v]split[a][b];[a][b]hstack"])
    assert two["size"] == [1024, 512] and all(two["frames"]), said
    sides = {x < 0.5 for x in hips(two)}
    assert len(sides) == 1 or "suddenly elsewhere" in said, (hips(two), said)  # one person is followed
    for side, left in enumerate([0, 512]):  # the one in the box
        box = f"{left},0,{left + 512},512"
        _, said, chosen = look(f"side_{side}", ["-c", "copy"], here / "two.mp4", ["--person", box])
        assert all((x > 0.5) == side for x in hips(chosen)), (side, hips(chosen), said)
    refused = [*frontend, here / "two.mp4", "--out", here / "x", "--person"]
    assert "nobody is found in that box of 0000.png" in run(*refused, "0,0,40,40", status=2)
    assert "X0 < X1 up to 1024, Y0 < Y1 up to 512" in run(*refused, "0,0,1025,512", status=2)
    upright, said, portrait = look("portrait", ["-vf", "crop=300:512"])
    assert portrait["size"] == [300, 512] and all(portrait["frames"]), said
    lying, _, _ = look("lying", ["-vf", "transpose=clock"], upright)
    _, said, turned = look("turned", ["-c", "copy", "-metadata:s:v", "rotate=90"], lying)
    assert turned["size"] == [300, 512], said
    assert all(abs(a - b) < 0.05 for a, b in zip(hips(turned), hips(portrait))), (hips(turned), hips(portrait))

    # Smoothed points are near those that were found, and rest more.
    _, said, rough = look("rough", ["-c", "copy"])
    _, said, smooth = look("smooth", ["-c", "copy"], options=["--smooth", "3"])
    assert all(abs(a - b) < 0.05 for a, b in zip(smooth["scores"], rough["scores"], strict=True)), said
    moved = [math.dist(a[:2], b[:2]) for t in range(3) for a, b in zip(smooth["frames"][t], rough["frames"][t])]
    assert 0 < max(moved) < 20, max(moved)

    # Somebody else from one frame to the next is told.
    (here / "cut").mkdir()
    for frame, left in enumerate([0, 0, 512, 512]):
        run("ffmpeg", "-v", "error", "-i", clip / "video.mp4", "-vf", f"pad=1024:512:{left}:0", "-frames:v", "1",
            here / f"cut/{frame}.png")
    said = run(*frontend, here / "cut", "--out", here / "found_cut")
    assert "the person is suddenly elsewhere in frames " in said, said

    environment = dict(os.environ, HSI4D=str(program))
    one = here / "one.mp4"
    run("ffmpeg", "-v", "error", "-i", clip / "video.mp4", "-frames:v", "1", one)
    said = run(tools / "from_video", one, "--out", here / "x", "--packages", packages, status=2, env=environment)
    assert "holds one picture and no video" in said and "frame 1 of" not in said, said
    assert "the video has 1 frames; allowed: two or more" in run(*frontend, one, "--out", here / "x", status=2)
    all_of_it = [tools / "from_video", clip / "video.mp4", "--out", here / "all", "--packages", packages, "--longest-side-px", 256]
    assert "quality: " in run(*all_of_it, env=environment)
    assert (here / "all/run/report.html").exists() and (here / "all/clip/plate.png").exists()
    # The same person in the scene, by a camera that is known roughly.
    guess = json.loads((clip / "camera.json").read_text())
    guess["world_to_camera"][0][3] += 0.05
    (here / "guess.json").write_text(json.dumps(guess))
    in_scene = [tools / "from_video", clip / "video.mp4", "--scene", clip / "scene.ply", "--guess", here / "guess.json",
                "--packages", packages, "--longest-side-px", 256, "--look", "kept", "--out", here / "in_scene"]
    assert "quality: " in run(*in_scene, env=environment)
    assert (here / "in_scene/camera.png").exists() and not (here / "in_scene/clip/plate.png").exists()

    assert "there is no such file" in run(tools / "from_video", here / "none.mp4", "--out", here / "x", status=2)

    assert "is there already" in run(*frontend, clip / "video.mp4", "--out", here / "found", status=2)
    assert "there is no such file" in run(*frontend, here / "none.mp4", "--out", here / "x", status=2)
    assert "allowed: lite, full, heavy" in run(*frontend, clip / "video.mp4", "--out", here / "x", "--model", "best", status=2)
    (here / "text.mp4").write_text("no video")
    assert "is no video" in run(*frontend, here / "text.mp4", "--out", here / "x", status=2)
    (here / "black").mkdir()
    run("ffmpeg", "-v", "error", "-f", "lavfi", "-i", "color=black:size=64x64:rate=1:duration=2", here / "black/%04d.png")
    assert "nobody is found in any frame" in run(*frontend, here / "black", "--out", here / "x", status=2)
    assert not (here / "x").exists()
print("passed")
