"""tools/services/clip_embeddings.py: it compiles, explains itself, and refuses what makes no sense. CLIP itself is not run.

    python3 tests/tools/clip_embeddings_test.py TOOLS        # the folder tools/
"""

import os
import pathlib
import subprocess
import sys
import tempfile

program = pathlib.Path(sys.argv[1]).resolve() / "services" / "clip_embeddings.py"


def run(*arguments):
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, str(program), *map(str, arguments)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60)


def check(result, status, *words):
    told = result.stdout + result.stderr
    assert result.returncode == status, (result.args, result.returncode, told)
    assert "Traceback" not in told, told
    for word in words:
        assert word in told, (word, told)


with tempfile.TemporaryDirectory() as name:
    folder = pathlib.Path(name)
    (folder / "0001_render.png").touch()
    good = {"--video": folder, "--text": "a person sits", "--frame-rate": 10, "--out": folder / "clip.npz"}

    def asked(**changes):
        arguments = {**good, **{"--" + key.replace("_", "-"): value for key, value in changes.items()}}
        return run(*[word for key, value in arguments.items() for word in (key, value)], "--dry-run")

    check(run("--help"), 0, "usage:", "--out", "hsi4d evaluate")
    check(run(), 2, "required")
    check(asked(), 0, "openai/clip-vit-base-patch32 on cpu", '"a person sits"', "clip.npz")
    check(asked(pattern="*_render.png", device="cuda", model="my/clip"), 0, "my/clip on cuda")
    check(asked(pattern="*.jpg"), 2, "has no file *.jpg")
    check(asked(video=folder / "none.mp4"), 2, "none.mp4: there is no such video")
    check(asked(out="clip.json"), 2, "--out: clip.json: allowed ending: .npz")
    check(asked(text=" "), 2, "--text: is empty")
    for rate in (0, -1, "nan", 1e9):
        check(asked(frame_rate=rate), 2, "--frame-rate:", "allowed: 0.01 to 100000")
    check(asked(batch=0), 2, "--batch: 0 is out of range")
    assert not (folder / "clip.npz").exists()
    assert os.access(program, os.X_OK)
print("passed")
