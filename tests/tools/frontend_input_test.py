"""What tools/frontend and tools/from_video say where something is missing or wrong, without a browser.

    python3 tests/tools/frontend_input_test.py TOOLS      # the folder tools/
"""

import hashlib
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

tools = pathlib.Path(sys.argv[1]).resolve()

# What the scripts call beside Node and Chromium.
needed = ["bash", "env", "dirname", "head", "sed", "mkdir", "mktemp", "rm", "mv", "grep"]
wrong, not_now = 2, 75  # exit statuses: a mistake in the command or an input; something cannot be installed


def run(*words, env=None, status=wrong):
    """What it says; it has to fail."""
    result = subprocess.run([str(word) for word in words], capture_output=True, text=True, env=env)
    assert result.returncode == status, f"exit status {result.returncode}: {result.stdout}{result.stderr}"
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


def whole_with_all_programs(folder):
    """The environment, with a Chromium that is there."""
    folder.mkdir()
    (folder / "chromium").write_text("#!/bin/sh\n")
    (folder / "chromium").chmod(0o755)
    return dict(os.environ, CHROMIUM=str(folder / "chromium"))


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

# Points over time: a person of 100 px whose points stand in a column and walk 2 px a frame to the right.
TRACK = """
import assert from 'node:assert';
import { byBytes, jumpsOf, scoresOf, smoothed, valueAtZero } from '%s';

// As std::sort orders names: by bytes, not by the units of UTF-16, and whatever their lengths.
assert.deepStrictEqual(['10.png', '9.png', '\\u00e9.png', 'z.png', '\\u{10000}.png', '\\uffff.png'].sort(byBytes),
  ['10.png', '9.png', 'z.png', '\\u00e9.png', '\\uffff.png', '\\u{10000}.png']);

const person = (x, visibility = 1) => Array.from({ length: 33 }, (_, i) => [x, 100 * i / 32, visibility]);
const near = (a, b, most = 1e-9) => assert(Math.abs(a - b) < most, `${a} is not ${b}`);
const scores = (frames) => scoresOf(frames).map(({ score }) => score);

const walk = [0, 2, 4, 6, 8].map((x) => person(x));
scores(walk.slice(1, 4)).slice(1, 2).forEach((score) => near(score, 1)); // between its neighbours
near(scores(walk)[0], 1 - 2 / 50); // at the end: 2 px from its neighbour, of half its height
assert.deepStrictEqual(jumpsOf(walk), []);
const leaping = walk.with(2, person(34)); // 30 px off, 60 %% of what is another person's
near(scores(leaping)[2], 0.4);
near(scores(leaping)[1], 1 - 15 / 50);
assert(!scoresOf(leaping)[2].isSteady && scoresOf(leaping)[2].isSeen);
near(scores(walk.with(2, person(64)))[2], 0); // never below 0
assert.deepStrictEqual(jumpsOf(walk.with(2, person(64))), [2, 3]);
near(scores(walk.with(2, person(4, 0.8)))[2], 0.8); // as visible as the limbs are
near(scores([person(0).map(([x, y], i) => [x, y, i < 11 ? 0.2 : 1])])[0], 22 / 33); // the share that is seen; no neighbour
assert.deepStrictEqual(scoresOf([[]])[0], { score: 0, isSeen: false, isSteady: true });

// Least squares with weights: a curve is met, noise is not, what has no weight is nothing.
near(valueAtZero([[-2, 7, 1], [-1, 4, 0.5], [1, 4, 1], [2, 7, 0.1]], 2), 3);
near(valueAtZero([[-1, 0, 1], [0, 3, 1], [1, 0, 1]], 1), 1);
near(valueAtZero([[-1, 0, 1], [0, 3, 2], [1, 0, 1]], 1), 1.5);
assert.strictEqual(valueAtZero([[1, 5, 0], [2, 5, 0], [3, 5, 0]], 2), undefined);

// Curves of time stay as they are, at both ends too; noise becomes less; whoever else comes is another track.
const curve = Array.from({ length: 12 }, (_, t) => person(t * t));
const places = curve.map((points) => points.map(([x, y]) => [x / 100, y / 100, x / 50]));
const same = smoothed(curve, places, 7);
same.points.forEach((points, t) => points.forEach((point, i) => point.forEach((number, k) => near(number, curve[t][i][k], 1e-6))));
same.places.forEach((rows, t) => rows.forEach((row, i) => row.forEach((number, k) => near(number, places[t][i][k], 1e-6))));
const noisy = Array.from({ length: 12 }, (_, t) => person(t %% 2));
const calm = smoothed(noisy, noisy, 7).points.map((points) => points[0][0]);
assert(calm.slice(3, 9).every((x) => Math.abs(x - 0.5) < 0.2), `${calm}`);
const cut = [...walk, [], ...walk.map((points) => points.map(([x, y, v]) => [x + 500, y, v]))];
const apart = smoothed(cut, cut, 9).points;
cut.forEach((points, t) => points.forEach(([x], i) => near(apart[t][i][0], x, 1e-6)));
const jump = [...walk, ...walk.map((points) => points.map(([x, y, v]) => [x + 500, y, v]))];
jump.forEach((points, t) => near(smoothed(jump, jump, 9).points[t][3][0], points[3][0], 1e-6));
const hidden = noisy.map((points, t) => points.map(([x, y]) => [x, y, t === 5 ? 0 : 1]));
near(smoothed(hidden, hidden, 7).points[5][0][0], hidden[5][0][0]); // what is not found stays where it is said to be
"""

# playwright-core: a browser whose page answers for BlazePose what found.json has of each picture, in the order in which
# they are looked at: [x of all points as a share of the width, visibility], or null. Notes the names in order.txt.
BROWSER = """
const fs = require('node:fs');
const here = `${__dirname}/../../..`, found = () => JSON.parse(fs.readFileSync(`${here}/found.json`));
let looked = 0;
function look(name) {
  fs.appendFileSync(`${here}/order.txt`, `${name}\\n`);
  const one = found()[looked++], size = { width: 64, height: 48 }, mask = Buffer.alloc(64 * 48, one ? 255 : 0).toString('base64');
  if (!one) return { ...size, mask };
  const points = Array.from({ length: 33 }, (_, i) => ({ x: one[0], y: 0.1 + 0.8 * i / 32, z: 0, visibility: one[1] }));
  return { ...size, mask, points, places: points };
}
const answers = { look, lookIntoBox: () => ({ isFound: found()[0] !== null, width: 64, height: 48 }), begin: () => undefined };
const page = { on() {}, async goto() {}, async evaluate(work, argument) { return answers[work.name](argument); } };
exports.chromium = { async launch() { return { async newPage() { return page; }, async close() {} }; } };
"""


def check_what_is_written(frontend, here, packages, env):
    """All of the front end but the detector, for which a stand-in answers."""
    browser = packages / "node_modules/playwright-core/index.js"
    browser.write_text(BROWSER)
    order = here / "order.txt"
    ffmpeg = ["ffmpeg", "-v", "error", "-f", "lavfi", "-i", "testsrc=size=64x48:rate=10:duration=0.6"]
    subprocess.run([*ffmpeg, here / "six.mp4"], check=True)
    subprocess.run([*ffmpeg, "-start_number", "0", here / "%d.png"], check=True)
    folder = here / "frames"
    folder.mkdir()
    names = ["10.png", "9.png", "Z.png", "a.png", "é.png", "\uffff.png"]  # in hsi4d's order; by length "9.png" were first
    for number, name in enumerate(names):
        (here / f"{number}.png").rename(folder / name)

    def find(source, found, *options, status=0):
        (here / "found.json").write_text(json.dumps(found))
        order.write_text("")
        out = here / "written"
        shutil.rmtree(out, ignore_errors=True)
        words = [*frontend, source, "--out", out, "--packages", packages, "--no-install", *options]
        result = subprocess.run([str(word) for word in words], capture_output=True, text=True, env=env)
        assert result.returncode == status, result.stdout + result.stderr
        said = result.stdout + result.stderr
        if status != 0:
            assert not out.exists()
            return said, None, None
        masks = sorted((path.name for path in (out / "masks/human").iterdir()), key=lambda name: name.encode())
        return said, json.loads((out / "keypoints.json").read_text()), masks

    walk = [[0.3 + 0.01 * t, 0.9] for t in range(6)]
    said, written, masks = find(here / "six.mp4", walk)
    assert masks == [f"000{t}.png" for t in range(6)], masks
    assert written["size"] == [64, 48] and written["frames"][2][0] == [20.48, 4.8, 0.9], written
    assert written["scores"] == [0.9] * 6, written["scores"]
    assert "frontend: the score is 0.9 to 0.9, below 0.5 in 0 of 6 frames" in said, said
    _, _, masks = find(folder, walk)
    assert order.read_text().splitlines() == names and masks == names, (order.read_text(), masks)

    # Each reason has its words, and its frames.
    said, written, _ = find(here / "six.mp4", [*walk[:2], None, [0.33, 0.2], [0.34, 0.9], [0.95, 0.9]])
    assert "nobody is found in frames 2; their masks are black" in said, said
    assert "less than half of the person is seen in frames 3" in said, said
    assert "the person is suddenly elsewhere in frames 5" in said, said
    assert written["frames"][2] == [] and written["scores"][2] == 0 and written["scores"][3] == 0, written["scores"]
    said, _, _ = find(here / "six.mp4", [[0.3, 0.9], [0.3, 0.9], [0.54, 0.9], [0.3, 0.9], [0.3, 0.9], [0.3, 0.9]])
    assert "the points leap in frames 2" in said and "elsewhere" not in said, said
    assert "nobody is found in any frame" in find(here / "six.mp4", [None] * 6, status=wrong)[0]
    assert "nobody is found in that box of 0000.png" in find(here / "six.mp4", [None] * 6, "--person", "0,0,9,9", status=wrong)[0]
    assert "X0 < X1 up to 64, Y0 < Y1 up to 48" in find(here / "six.mp4", walk, "--person", "9,9,65,20", status=wrong)[0]

    # Smoothed points; scores are of what was found.
    shaken = [[0.3 + 0.02 * (t % 2), 0.9] for t in range(6)]
    _, rough, _ = find(here / "six.mp4", shaken)
    _, calm, _ = find(here / "six.mp4", shaken, "--smooth", "5")
    across = [[frame[0][0] for frame in written["frames"]] for written in (rough, calm)]
    assert max(across[1][1:5]) - min(across[1][1:5]) < 0.6 * (max(across[0]) - min(across[0])), across
    assert calm["scores"] == rough["scores"] and calm["landmarks"] != rough["landmarks"]


# hsi4d: notes how it was called, and says of the camera what the file `word` has.
STAND_IN = """#!/bin/bash
cd "$(dirname "$0")" || exit
[[ $* == *--help ]] && { echo --check; exit 0; }
echo "$*" >>calls.txt
[[ $* == *--check ]] && { [[ ! -e refused ]] || { cat refused >&2; exit 2; }; exit 0; }
case $1 in
  locate) echo "  PSNR of the compared pixels: 9.0 dB before, 9.1 dB ($(cat word))"; while [[ $1 != --out ]]; do shift; done; touch "$2" ;;
  init) while [[ $1 != --out ]]; do shift; done; mkdir "$2" ;;
esac
"""

with tempfile.TemporaryDirectory() as name:
    here = pathlib.Path(name)
    video = here / "video.mp4"
    video.write_text("no video")
    frontend = [tools / "frontend", video, "--out", here / "found", "--packages", here / "packages"]
    no_node, no_ffmpeg = path_with(here / "a", ["ffmpeg"]), path_with(here / "b", ["node"])
    no_chromium = path_with(here / "c", ["node", "ffmpeg"])
    assert "there is no node, and it cannot be installed (Debian package nodejs)" in run(*frontend, env=no_node, status=not_now)
    assert "there is no ffmpeg, and it cannot be installed (Debian package ffmpeg)" in run(*frontend, env=no_ffmpeg, status=not_now)
    said = run(*frontend, env=no_chromium, status=not_now)
    assert "there is no Chromium, and it cannot be installed (Debian package chromium)" in said, said
    # What must not install says how to, and does nothing.
    (here / "packages").rmdir()
    quietly = [*frontend, "--no-install"]
    how = f"tools/frontend --install --packages {here}/packages installs it"
    assert f"there is no node (Debian package nodejs); {tools.parent}/{how}" in run(*quietly, env=no_node)
    assert "there is no Chromium (Debian package chromium); " in run(*quietly, env=no_chromium)
    with_all = path_with(here / "e", ["node", "ffmpeg", "chromium"])
    assert f"BlazePose is not there; {tools.parent}/{how}" in run(*quietly, env=with_all)
    assert not (here / "packages").exists()
    assert "say the opposite" in run(*quietly, "--install")

    # A package that is not whole.
    pose = here / "packages/node_modules/@mediapipe/pose"
    pose.mkdir(parents=True)
    (here / "packages/node_modules/playwright-core").mkdir()
    for file in ["pose.js", "pose_landmark_full.tflite", "pose_web.binarypb", "pose_solution_packed_assets.data"]:
        (pose / file).write_text("something")
    whole = with_all
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
        run_node(TRACK % (tools / "services/track.mjs").as_uri())
        # A clip has two frames; this is known before the browser begins.
        (here / "one").mkdir()
        (here / "one/0.png").write_text("a picture")
        blazepose = ["node", tools / "services/blazepose.mjs", "--packages", here, "--model", "full", "--out", here / "x"]
        assert f"{here}/one has 1 .png frames; allowed: two or more" in run(*blazepose, "--frames", here / "one")
        assert "the video has 1 frames" in run(*blazepose, "--frames", here / "one", "--numbered")
        if shutil.which("ffmpeg"):
            check_what_is_written([tools / "frontend"], here, here / "packages", whole_with_all_programs(here / "f"))

    assert "allowed: lite, full, heavy" in run(*frontend, "--model", "best")
    assert "allowed: X0,Y0,X1,Y1, whole pixels of the first frame" in run(*frontend, "--person", "1,2,3")
    for frames in ["2", "4", "1", "101", "five", "-3"]:
        assert "allowed: odd ones from 3 to 99" in run(*frontend, "--smooth", frames)
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
    for option in ["--frame-rate", "--video-rate", "--camera-height", "--focal-px", "--longest-side-px"]:
        assert f"{option}: abc is no number" in run(*from_video, option, "abc")
    assert "--threads: two is no number of threads" in run(*from_video, "--threads", "two")
    assert "--starts: many is no number" in run(*in_scene, "--guess", video, "--starts", "many")
    assert not (here / "x").exists()

    # A folder of another video or of other options is no place for this one.
    (here / "y/found").mkdir(parents=True)
    (here / "y/found_of.txt").write_text("video another\n")
    said = run(tools / "from_video", video, "--out", here / "y")
    assert "found was made of another video or with other options; then (<) and now (>): < video another > video " in said, said
    (here / "y/found_of.txt").unlink()
    assert "holds found, and no found_of.txt says of what; name a new folder" in run(tools / "from_video", video, "--out", here / "y")
    assert "none.safetensors: there is no such file" in run(*from_video, "--avatar", here / "none.safetensors")

    # The order of the work, with a stand-in for hsi4d, on a folder in which the person is found already.
    program = here / "program/hsi4d"
    program.parent.mkdir()
    program.write_text(STAND_IN)
    program.chmod(0o755)
    calls = program.parent / "calls.txt"
    word = program.parent / "word"
    environment = dict(os.environ, HSI4D=str(program))
    guess = here / "guess.json"
    guess.write_text("{}")
    words = [str(video), "--scene", str(video), "--guess", str(guess), "--look", "kept", "--frame-rate", "5"]
    all_of_it = [tools / "from_video", *words, "--out", here / "z"]
    def hashed(file):
        return hashlib.sha256(pathlib.Path(file).read_bytes()).hexdigest()

    (here / "z/found/masks").mkdir(parents=True)
    (here / "z/found_of.txt").write_text(f"video {hashed(video)}\n")

    # Video and options are looked at first.
    (program.parent / "refused").write_text("hsi4d: error: gives 1 of its 1 frames\n")
    assert "gives 1 of its 1 frames" in run(*all_of_it, env=environment)
    found = here / "z/found"
    looked = (f"init {video} --keypoints {found}/keypoints.json --masks {found}/masks --frame-rate 5 "
              f"--scene {video} --out {here}/z/clip --check")
    assert calls.read_text() == looked + "\n", calls.read_text()
    (program.parent / "refused").unlink()

    # A camera of which the program says fail ends the work, each time; one option goes on.
    word.write_text("fail")
    for _ in range(2):
        said = run(*all_of_it, env=environment)
        assert "the camera is not found: hsi4d locate says fail" in said and "--any-camera" in said, said
    assert [line.split()[0] for line in calls.read_text().splitlines()] == ["init", "init", "locate", "init"]
    assert not (here / "z/clip").exists()
    result = subprocess.run([str(text) for text in [*all_of_it, "--any-camera"]], capture_output=True, text=True, env=environment)
    assert result.returncode == 0, result.stdout + result.stderr
    done = calls.read_text().splitlines()[4:]
    assert [line.split()[0] for line in done] == ["init", "init", "run"], done
    assert f"--camera {here}/z/camera.json --scene {video}" in done[1] and "--check" in done[0] and "--frame-rate 5" in done[1], done
    # Only then do other options need another folder; their order says nothing.
    said = run(*all_of_it, "--frame-rate", "4", env=environment)
    assert "clip was made of" in said and "< --frame-rate 5" not in said and "> --frame-rate 4" in said, said
    # A good one needs no option.
    word.write_text("pass")
    for file in ["camera.json", "camera.txt"]:
        (here / "z" / file).unlink()
    result = subprocess.run([str(text) for text in all_of_it], capture_output=True, text=True, env=environment)
    assert result.returncode == 0 and "9.1 dB (pass)" in result.stdout, result.stdout + result.stderr
    assert "== the camera in the scene" in result.stderr and "== the motion" in result.stderr, result.stderr
print("passed")
