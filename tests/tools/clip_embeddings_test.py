"""tools/services/clip_embeddings.py: it explains itself, refuses what makes no sense, and writes what a model returns, by
stand-ins for CLIP of transformers 4 and 5.

    python3 tests/tools/clip_embeddings_test.py TOOLS        # the folder tools/
"""

import json
import os
import pathlib
import struct
import subprocess
import sys
import tempfile
import zipfile

program = pathlib.Path(sys.argv[1]).resolve() / "services" / "clip_embeddings.py"


# What the script takes of PyTorch, Pillow and transformers. An image's embedding is its file's length and 1, a text's
# its own length and 2.
STAND_INS = {
    "torch.py": """
import contextlib
import numpy

class Tensor:
    def __init__(self, rows):
        self.rows = numpy.array(rows, dtype=numpy.float32)
    def float(self):
        return self
    def cpu(self):
        return self
    def numpy(self):
        return self.rows

inference_mode = contextlib.nullcontext
""",
    "PIL.py": """
import pathlib

class Image:
    @staticmethod
    def open(file):
        image = Image()
        image.length = len(pathlib.Path(file).read_bytes())
        return image
    def convert(self, mode):
        assert mode == "RGB"
        return self
""",
    "transformers.py": """
import os
import torch

class Inputs(dict):
    def to(self, device):
        return self

class CLIPProcessor:
    @staticmethod
    def from_pretrained(name):
        return CLIPProcessor()
    def __call__(self, images=None, text=None, **others):
        return Inputs(images=images) if text is None else Inputs(text=text)

class BaseModelOutputWithPooling:
    def __init__(self, pooled):
        self.last_hidden_state = None
        self.pooler_output = pooled

class CLIPModel:
    @staticmethod
    def from_pretrained(name):
        return CLIPModel()
    def to(self, device):
        return self
    def eval(self):
        return self
    def returned(self, rows):
        tensor = torch.Tensor(rows)
        return tensor if os.environ["TRANSFORMERS"] == "4" else BaseModelOutputWithPooling(tensor)
    def get_image_features(self, images):
        return self.returned([[image.length, 1] for image in images])
    def get_text_features(self, text):
        return self.returned([[len(words), 2] for words in text])
""",
}


def run(*arguments, **variables):
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1", **variables}
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

    # Runs and sweeps say all of it themselves.
    def write_run(run, state="done", prompt="a person sits", rate=10.0):
        (run / "frames").mkdir(parents=True)
        for number in range(3):
            (run / "frames" / f"000{number}_render.png").write_bytes(b"x" * (number + 1))
        (run / "frames" / "0000_target.png").touch()
        (run / "status.json").write_text(json.dumps({"state": state}))
        (run / "config.resolved.json").write_text(json.dumps({"instance": {"prompt": prompt}}))
        header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (), }".ljust(117) + b"\n"
        with zipfile.ZipFile(run / "motion.npz", "w") as motion:
            motion.writestr("mocap_frame_rate.npy", b"\x93NUMPY\x01\x00v\x00" + header + struct.pack("<d", rate))

    write_run(folder / "one", rate=25.0)
    write_run(folder / "sweep" / "runs" / "aa")
    write_run(folder / "sweep" / "runs" / "bb", state="running")
    write_run(folder / "silent", prompt="")
    (folder / "sweep" / "sweep.json").write_text(json.dumps({"runs": [{"id": "aa"}, {"id": "bb"}, {"id": "aa"}, {"id": "cc"}]}))
    both = ("--runs", folder / "one", folder / "sweep")
    told = run(*both, "--dry-run")
    check(told, 0, 'one/clip.npz: 3 frames at 25 a second, "a person sits"', "aa/clip.npz: 3 frames at 10 a second")
    assert told.stdout.count("\n") == 2, told.stdout
    check(run("--runs", folder / "silent"), 2, "silent: its config says no text")
    check(run("--runs", folder), 2, "holds no run of hsi4d and no sweep")
    check(run(*both, "--text", "x"), 2, "--text is not for --runs")

    try:
        import numpy
    except ImportError:
        print("there is no NumPy: what is written is not tested")
        sys.exit(77)
    for module, text in STAND_INS.items():
        (folder / "modules" / module).parent.mkdir(exist_ok=True)
        (folder / "modules" / module).write_text(text)
    for number in range(2, 6):
        (folder / f"000{number}_render.png").write_bytes(b"x" * number)
    paths = os.pathsep.join(filter(None, [str(folder / "modules"), os.environ.get("PYTHONPATH", "")]))
    modules = {"PYTHONPATH": paths, "TRANSFORMERS": "5"}
    for version in ("4", "5"):
        out = folder / f"clip{version}.npz"
        check(run("--video", folder, "--text", "sits", "--frame-rate", 30, "--out", out, "--batch", 2,
                  PYTHONPATH=paths, TRANSFORMERS=version), 0, "5 frames, 2 numbers each")
        made = numpy.load(out)
        assert made["image_embeddings"].tolist() == [[0, 1], [2, 1], [3, 1], [4, 1], [5, 1]], version
        assert made["text_embedding"].tolist() == [4, 2]
        assert (made["frame_rate"], str(made["prompt"])) == (30, "sits")
    check(run(*both, **modules), 0, "one/clip.npz: 3 frames, 2 numbers each", "aa/clip.npz")
    made = numpy.load(folder / "one" / "clip.npz")
    assert made["image_embeddings"].tolist() == [[1, 1], [2, 1], [3, 1]] and made["frame_rate"] == 25
    check(run(*both, **modules), 0, "every run has its embeddings")
    os.utime(folder / "one" / "clip.npz", (1, 1))  # frames that were computed since
    check(run(*both, "--dry-run"), 0, "one/clip.npz: 3 frames at 25")
print("passed")
