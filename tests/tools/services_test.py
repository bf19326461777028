"""The programs in tools/services: they compile, explain themselves, and tell what they would run; those of KLING and Sora
are used with stand-ins of the services on this machine, SAM 2's with one of the package (stubs/).

    python3 tests/tools/services_test.py TOOLS        # the folder tools/; all but SAM 2's
    python3 tests/tools/services_test.py TOOLS sam2   # that alone

Exit status 77 (skipped) without ffmpeg, with which videos are made and looked at; of SAM 2's without NumPy and Pillow, with
which masks are.
"""

import base64
import email
import email.policy
import hashlib
import hmac
import http.server
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading

services = pathlib.Path(sys.argv[1]).resolve() / "services"
PROGRAMS = ["kling.py", "sora.py", "wan.py", "sam2_masks.py", "poses.py", "stand_in/video.py", "stand_in/masks.py", "stand_in/poses.py"]

if shutil.which("ffmpeg") is None or shutil.which("ffprobe") is None:
    print("skipped: there is no ffmpeg")
    sys.exit(77)


def run(program, *arguments, **more):
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1", **more}
    command = [sys.executable, str(services / program), *map(str, arguments)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60)


def check(result, status, *words):
    told = result.stdout + result.stderr
    assert result.returncode == status, (result.args, result.returncode, told)
    assert "Traceback" not in told, told
    for word in words:
        assert word in told, (word, told)


def picture(path, size, frames=1):
    subprocess.run(["ffmpeg", "-v", "error", "-f", "lavfi", "-i", f"testsrc2=size={size}:rate=10", "-frames:v",
                    str(frames), str(path)], check=True)


def size_of(path):
    asked = ["ffprobe", "-v", "error", "-show_entries", "stream=width,height", "-of", "csv=p=0", str(path)]
    return subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()


def matrix_of(path):
    asked = ["ffprobe", "-v", "error", "-show_entries", "stream=color_space", "-of", "csv=p=0", str(path)]
    return subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()


def test_programs():
    for program in PROGRAMS:
        check(run(program, "--help"), 0, "usage:", "--out")
        check(run(program), 2, "required")
        assert os.access(services / program, os.X_OK), program


def test_dry_runs(folder):
    picture(folder / "image.png", "64x48")
    (folder / "wan").mkdir()
    image = folder / "image.png"
    check(run("wan.py", "--folder", folder / "wan", "--image", image, "--prompt", "p", "--out", "o.mp4", "--dry-run"), 2,
          "generate.py: there is no such program")
    (folder / "wan" / "generate.py").touch()
    check(run("wan.py", "--folder", folder / "wan", "--image", image, "--prompt", "it's", "--out", "o.mp4", "--dry-run"), 0,
          "in " + str(folder / "wan"), "--task i2v-14B", """'--prompt=it'"'"'s'""")
    (folder / "masks").mkdir()
    shutil.copy(image, folder / "masks" / "human.png")
    (folder / "frames").mkdir()
    shutil.copy(image, folder / "frames" / "0000.png")
    mask = ["--video", folder / "frames", "--first", folder / "masks", "--out", folder / "out", "--dry-run"]
    check(run("sam2_masks.py", "--objects", "human", *mask), 0, "follows human through")
    check(run("sam2_masks.py", "--objects", "human,can", *mask), 2, "can.png: there is no such mask")
    pose = ["--folder", folder / "wan", "--video", folder / "frames", "--out", folder / "m.npz", "--dry-run"]
    check(run("poses.py", "--estimator", "gvhmr", "--rate", 10, *pose), 0, "ffmpeg", "tools/demo/demo.py", "--static_cam",
          "hmr4d_results.pt", "--fps 10.0")
    check(run("poses.py", "--estimator", "wham", "--rate", 10, "--moving", "--person", 1, *pose), 0, "wham_output.pkl",
          "--person 1")
    check(run("poses.py", "--estimator", "wham", "--rate", 0, *pose), 2, "data.video_rate")


def test_names(folder):
    """Paths and prompts that mean something else to the programs that are run."""
    image = folder / "image.png"
    (folder / "bin").mkdir()
    (folder / "bin" / "python").symlink_to(sys.executable)
    wan = ["--folder", folder / "wan", "--image", image, "--out", "o.mp4", "--dry-run"]
    told = run("wan.py", *wan, "--prompt=-x 3 steps", "--python", os.path.relpath(folder / "bin" / "python"))
    check(told, 0, str(folder / "bin" / "python") + " generate.py", "'--prompt=-x 3 steps'")
    check(run("wan.py", *wan, "--prompt=p", "--python", "python3"), 0, ": python3 generate.py")
    pose = ["--folder", folder / "wan", "--video", folder / "frames", "--out", folder / "m.npz", "--rate", 10, "--dry-run"]
    check(run("poses.py", "--estimator", "wham", *pose, "--python", os.path.relpath(folder / "bin" / "python")), 0,
          str(folder / "bin" / "python") + " demo.py", str(folder / "bin" / "python") + " " + str(services.parent / "export_motion.py"))
    # A folder whose name is a pattern.
    odd = folder / "take [1]*"
    odd.mkdir()
    for number in range(3):
        shutil.copy(image, odd / f"{number:04d}.png")
    code = f"import service, sys; print(service.as_video({str(odd)!r}, 10, {str(folder)!r})); print(len(service.frame_names(sys.argv[1])))"
    made = subprocess.run([sys.executable, "-c", code, str(folder / "video.mp4")], cwd=services, capture_output=True, text=True,
                          check=False, env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"})
    assert made.stdout.split() == [str(folder / "video.mp4"), "3"], (made.stdout, made.stderr)


def test_fit(folder):
    """A video of the image's shape is scaled, another one is refused; without ffprobe that is told."""
    image, out = folder / "image.png", folder / "fitted.mp4"

    def fit(video, more="", **environment):
        code = f"import service; service.fit_video({str(video)!r}, {str(image)!r}, {str(out)!r}{more})"
        return subprocess.run([sys.executable, "-c", code], cwd=services, capture_output=True, text=True, check=False,
                              env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1", **environment})

    picture(folder / "near.mp4", "130x96", 2)
    check(fit(folder / "near.mp4"), 0)
    assert size_of(out) == "64,48", size_of(out)
    assert matrix_of(out) == "smpte170m", matrix_of(out)
    picture(folder / "high.mp4", "1280x960", 2)  # BT.709, as it names none
    check(fit(folder / "high.mp4"), 0)
    assert matrix_of(out) == "bt709", matrix_of(out)
    picture(folder / "wide.mp4", "132x96", 2)
    check(fit(folder / "wide.mp4"), 1, "the model's video is 132x96, the first frame 64x48: their shapes differ by 3.1 %, at most 2 %")
    check(fit(folder / "wide.mp4", ", 0.035"), 0)
    check(fit(folder / "near.mp4", PATH=str(folder)), 2, "ffprobe: cannot be run")
    check(fit(image.parent / "nothing.mp4"), 1, "is no video that ffprobe can read")


def test_streams(folder):
    """The stream that hsi4d reads is taken: no cover picture, and of several the first, which is told."""
    cover, film = folder / "image.png", folder / "long.mp4"
    picture(film, "132x96", 5)
    picture(folder / "other.mp4", "64x48", 7)
    covered, two, out = folder / "covered.mkv", folder / "two.mkv", folder / "first.mp4"
    both = ["-map", "0:v", "-map", "1:v", "-c", "copy"]
    for words in (["-i", cover, "-i", film, *both, "-disposition:v:0", "attached_pic", covered], ["-i", film, "-i", folder / "other.mp4", *both, two]):
        subprocess.run(["ffmpeg", "-v", "error", *map(str, words)], check=True)

    def asked(code):
        return subprocess.run([sys.executable, "-c", "import service; " + code], cwd=services, capture_output=True, text=True,
                              check=False, env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"})

    told = asked(f"print(len(service.frame_names({str(covered)!r})), service.stream_words({str(covered)!r}))")
    check(told, 0, "5 ['-map', '0:1']")
    assert not told.stderr, told.stderr
    told = asked(f"print(len(service.frame_names({str(two)!r}))); service.fit_video({str(two)!r}, {str(cover)!r}, {str(out)!r}, 0.035)")
    check(told, 0, "5\n", "two.mkv: holds 2 videos; stream 0 is read, not 1")
    assert size_of(out) == "64,48", size_of(out)


def test_end(folder):
    """A service that is asked to end leaves nothing."""
    (folder / "tmp").mkdir()
    (folder / "wan" / "generate.py").write_text("import time; print('begun', flush=True); time.sleep(600)")
    process = subprocess.Popen([sys.executable, str(services / "wan.py"), "--folder", str(folder / "wan"), "--image",
                                str(folder / "image.png"), "--prompt=p", "--out", str(folder / "o.mp4")],
                               stderr=subprocess.PIPE, text=True,
                               env={**os.environ, "TMPDIR": str(folder / "tmp"), "PYTHONDONTWRITEBYTECODE": "1"})
    assert process.stderr.readline() == "begun\n"
    assert len(list((folder / "tmp").iterdir())) == 1
    process.send_signal(signal.SIGTERM)
    assert process.wait(60) == 143, process.returncode
    process.stderr.close()
    assert not list((folder / "tmp").iterdir())


def test_example(folder):
    """The script of docs/services.md, with programs in the place of ssh and scp that stay on this machine."""
    page = (services.parent.parent / "docs" / "services.md").read_text(encoding="utf-8")
    script = re.search(r"```sh\n(.*?)```", page, re.S).group(1)
    here = folder / "example"
    (here / "bin").mkdir(parents=True)
    (here / "model").mkdir()
    (here / "remote").mkdir()

    def program(path, text):
        path.write_text("#!/bin/sh\n" + text)
        path.chmod(0o755)

    program(here / "service", script.removeprefix("#!/bin/sh\n"))
    program(here / "bin" / "ssh", f'test -e "{here}/down" && exit 255\ncd "{here}" && shift && exec sh -c "$*"\n')
    program(here / "bin" / "scp", f'test -e "{here}/down" && exit 255\nexec cp "${{1#gpu:}}" "${{2#gpu:}}"\n')
    program(here / "model" / "generate", 'test -e wrong && exit 3\ncat "$1" > "$3" && printf %s "$2" >> "$3"\n')
    (here / "in.png").write_text("image ")
    environment = {**os.environ, "PATH": f"{here / 'bin'}:{os.environ['PATH']}", "TMPDIR": str(here / "remote")}

    def example(prompt):
        return subprocess.run([str(here / "service"), "in.png", prompt, "out.mp4"], cwd=here, env=environment, capture_output=True,
                              text=True, check=False)

    prompt = """it's "quoted" $HOME `id` ; \\ -x"""
    check(example(prompt), 0)
    assert (here / "out.mp4").read_text() == "image " + prompt, (here / "out.mp4").read_text()
    assert not list((here / "remote").iterdir())
    (here / "model" / "wrong").touch()
    check(example("p"), 3)  # the model's own status, which is no reason to try again
    assert not list((here / "remote").iterdir())
    (here / "down").touch()
    check(example("p"), 75)


class QuietServer(http.server.BaseHTTPRequestHandler):
    def log_message(self, *_):
        pass

    def answer(self, status, content, kind="application/json"):
        body = content if isinstance(content, bytes) else json.dumps(content).encode()
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)


class StandIn(QuietServer):
    """KLING as its description has it: a task is accepted, is looked at twice, and has a video."""

    tasks, looks, requests, refuse, breaks = {}, {}, [], [], []

    def is_signed(self):
        head, claims, signature = self.headers["Authorization"].removeprefix("Bearer ").split(".")
        expected = hmac.new(b"secret", f"{head}.{claims}".encode(), hashlib.sha256).digest()
        issuer = json.loads(base64.urlsafe_b64decode(claims + "=="))["iss"]
        return issuer == "access" and base64.urlsafe_b64encode(expected).rstrip(b"=").decode() == signature

    def do_POST(self):
        body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        StandIn.requests.append(body)
        if not self.is_signed():
            return self.answer(401, {"code": 1000, "message": "signature"})
        if StandIn.refuse:
            return self.answer(*StandIn.refuse.pop(0))
        name = f"task{len(StandIn.requests)}"
        StandIn.tasks[name] = "failed" if body["prompt"] == "forbidden" else "succeed"
        self.answer(200, {"code": 0, "data": {"task_id": name, "task_status": "submitted"}})

    def do_GET(self):
        if self.path == "/video.mp4" and StandIn.breaks:
            StandIn.breaks.pop()
            self.send_response(200)
            self.send_header("Content-Length", str(len(StandIn.video)))
            self.end_headers()
            return self.wfile.write(StandIn.video[:100])
        if self.path == "/video.mp4":
            return self.answer(200, StandIn.video, "video/mp4")
        name = self.path.rsplit("/", 1)[1]
        if name not in StandIn.tasks:
            return self.answer(404, {"code": 1203, "message": "no such task"})
        StandIn.looks[name] = StandIn.looks.get(name, 0) + 1
        if StandIn.looks[name] < 3:
            return self.answer(200, {"code": 0, "data": {"task_id": name, "task_status": "processing"}})
        url = f"http://127.0.0.1:{self.server.server_port}/video.mp4"
        self.answer(200, {"code": 0, "data": {"task_id": name, "task_status": StandIn.tasks[name],
                                              "task_status_msg": "it may not be shown", "task_result": {"videos": [{"url": url}]}}})


def test_kling(folder):
    image, out, tasks = folder / "image.png", folder / "made.mp4", folder / "tasks"
    picture(folder / "large.mp4", "128x96", 5)
    StandIn.video = (folder / "large.mp4").read_bytes()
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), StandIn)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    keys = {"KLING_ACCESS_KEY": "access", "KLING_SECRET_KEY": "secret"}

    url = f"http://127.0.0.1:{server.server_port}"

    def kling(prompt, *more, **environment):
        return run("kling.py", "--image", image, "--prompt", prompt, "--out", out, "--url", url, "--poll", 0.05, "--tasks",
                   tasks, *more, **{**keys, **environment})

    check(kling("sits", KLING_ACCESS_KEY=""), 2, "have to be in the environment")
    check(kling("sits", "--dry-run"), 0, "POST", '"prompt": "sits"', '"model_name": "kling-v1"')
    assert not StandIn.requests
    check(kling("sits"), 0)
    assert size_of(out) == "64,48", size_of(out)  # of the image: what was made is larger
    assert base64.b64decode(StandIn.requests[0]["image"]) == image.read_bytes()
    assert not list(tasks.iterdir())
    check(kling("sits", KLING_SECRET_KEY="wrong"), 1, "answers 401")
    StandIn.refuse = [(429, {"code": 1302, "message": "too many"}), (503, {}), (200, {"code": 1102, "message": "no credit"})]
    check(kling("sits"), 75, "answers 429")
    check(kling("sits"), 75, "answers 503")
    check(kling("sits"), 1, "no credit")
    check(kling("forbidden"), 1, "has failed: it may not be shown")
    StandIn.refuse = [(200, {"code": 0, "data": {}}), (200, {"code": 0, "data": {"task_id": "none"}})]
    check(kling("sits"), 1, "not as its description has it: KeyError('task_id')")
    check(kling("sits"), 1, "answers 404")  # of the number that it has just given
    assert [path.suffix for path in tasks.iterdir()] == [".task"]
    next(tasks.iterdir()).unlink()
    # A task that is paid for is gone on with: this one was accepted before the run was ended.
    paid = len(StandIn.requests)
    StandIn.tasks["paid"] = "succeed"
    body = StandIn.requests[0]
    name = hashlib.sha256(json.dumps([url, body, 0]).encode()).hexdigest()[:16] + ".task"
    (tasks / name).write_text("paid\n")
    check(kling("sits"), 0)
    assert len(StandIn.requests) == paid and StandIn.looks["paid"] == 3
    # Another seed is another task, of the same request.
    (tasks / name).write_text("paid\n")
    check(kling("sits", "--seed", 1), 0)
    assert len(StandIn.requests) == paid + 1 and StandIn.requests[-1] == body
    paid += 1
    (tasks / name).unlink()
    # An answer that breaks off is no video; the next time the same task is asked for.
    StandIn.breaks = [True]
    check(kling("breaks"), 75, "no connection")
    assert len(StandIn.requests) == paid + 1 and [path.suffix for path in tasks.iterdir()] == [".task"]
    check(kling("breaks"), 0)
    assert len(StandIn.requests) == paid + 1 and not list(tasks.iterdir())
    # A task that the service no longer knows is told, forgotten, and asked for anew.
    (tasks / name).write_text("lost\n")
    check(kling("sits"), 0, "task lost, which was paid for, is gone, and a new one is asked for: the service answers 404")
    assert len(StandIn.requests) == paid + 2 and not list(tasks.iterdir())
    (tasks / name).write_text("paid\n")
    server.shutdown()
    server.server_close()
    check(kling("sits"), 75, "no connection")
    assert (tasks / name).read_text() == "paid\n"  # which is paid for, and not lost with a connection


class SoraStandIn(QuietServer):
    """OpenAI's service as its description has it: a task is accepted by a form, is looked at twice, and has a video."""

    forms, looks = [], {}

    def do_POST(self):
        content = self.rfile.read(int(self.headers["Content-Length"]))
        if self.headers["Authorization"] != "Bearer key":
            return self.answer(401, {"error": {"message": "no such key"}})
        told = email.message_from_bytes(f"Content-Type: {self.headers['Content-Type']}\n\n".encode() + content, policy=email.policy.HTTP)
        SoraStandIn.forms.append({part.get_param("name", header="Content-Disposition"): part.get_payload(decode=True)
                                  for part in told.iter_parts()})
        self.answer(200, {"id": f"video_{len(SoraStandIn.forms)}", "status": "queued"})

    def do_GET(self):
        name = self.path.split("/")[3]
        if not name.startswith("video_"):
            return self.answer(404, {"error": {"message": "no such video"}})
        if self.path.endswith("/content"):
            return self.answer(200, SoraStandIn.video, "video/mp4")
        SoraStandIn.looks[name] = SoraStandIn.looks.get(name, 0) + 1
        if SoraStandIn.looks[name] < 3:
            return self.answer(200, {"id": name, "status": "in_progress"})
        if SoraStandIn.forms[-1]["prompt"] == b"forbidden":
            return self.answer(200, {"id": name, "status": "failed", "error": {"message": "it may not be shown"}})
        self.answer(200, {"id": name, "status": "completed"})


def test_sora(folder):
    image, out, tasks = folder / "image.png", folder / "sora.mp4", folder / "sora_tasks"
    SoraStandIn.video = (folder / "large.mp4").read_bytes()
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), SoraStandIn)
    threading.Thread(target=server.serve_forever, daemon=True).start()

    url = f"http://127.0.0.1:{server.server_port}"

    def sora(prompt, *more, **environment):
        return run("sora.py", "--image", image, "--prompt", prompt, "--out", out, "--url", url, "--poll", 0.05, "--tasks", tasks,
                   *more, **{"OPENAI_API_KEY": "key", **environment})

    check(sora("sits", OPENAI_API_KEY=""), 2, "OPENAI_API_KEY has to be in the environment")
    other = folder / "image.jpg"
    other.write_bytes(b"\xff\xd8\xff\xe0 a photograph")
    check(sora("sits", "--image", other), 2, "image.jpg: is no PNG file")
    check(sora("sits", "--dry-run"), 0, "POST", '"prompt": "sits"', '"size": "64x48"')
    check(sora("sits", OPENAI_API_KEY="wrong"), 1, "answers 401", "no such key")
    assert not SoraStandIn.forms
    check(sora("sits"), 0)
    assert size_of(out) == "64,48", size_of(out)
    assert SoraStandIn.forms == [{"model": b"sora-2", "prompt": b"sits", "seconds": b"4", "size": b"64x48",
                                  "input_reference": image.read_bytes()}], SoraStandIn.forms
    check(sora("forbidden"), 1, "has failed: it may not be shown")
    assert not list(tasks.iterdir())
    # A task that is paid for is gone on with; one that the service does not know is asked for anew.
    request = [{"model": "sora-2", "prompt": "sits", "seconds": "4", "size": "64x48"}, hashlib.sha256(image.read_bytes()).hexdigest()]
    kept = tasks / (hashlib.sha256(json.dumps([url, request, 7]).encode()).hexdigest()[:16] + ".task")
    SoraStandIn.forms[-1]["prompt"] = b"sits"
    asked = len(SoraStandIn.forms)
    kept.write_text("video_9\n")
    check(sora("sits", "--seed", 7), 0)
    assert len(SoraStandIn.forms) == asked and SoraStandIn.looks["video_9"] == 3
    kept.write_text("lost\n")
    check(sora("sits", "--seed", 7), 0, "task lost, which was paid for, is gone")
    assert len(SoraStandIn.forms) == asked + 1 and not list(tasks.iterdir())
    server.shutdown()
    server.server_close()


def test_sam2(folder):
    """The script's own code, from a film and two masks to folders of masks."""
    try:
        import numpy as np
        from PIL import Image
    except ImportError as missing:
        print(f"skipped: there is no {missing.name}")
        sys.exit(77)
    first, out = folder / "first", folder / "sam2"
    first.mkdir()
    for name, (left, top) in {"human": (4, 6), "can": (30, 20)}.items():
        mask = np.zeros((24, 32), np.uint8)  # half as large as the film
        mask[top // 2:top // 2 + 5, left // 2:left // 2 + 5] = 255
        Image.fromarray(mask).save(first / f"{name}.png")
    picture(folder / "film.mp4", "64x48", 4)
    masks = ["--video", folder / "film.mp4", "--objects", "human,can", "--first", first, "--out", out, "--device", "cpu"]
    stubs = pathlib.Path(__file__).resolve().parent / "stubs"
    check(run("sam2_masks.py", *masks), 2, "module")
    check(run("sam2_masks.py", *masks, PYTHONPATH=str(stubs)), 0)
    for name, left in {"human": 4, "can": 30}.items():
        assert sorted(path.name for path in (out / name).iterdir()) == [f"{frame:04d}.png" for frame in range(4)]
        for frame in range(4):
            seen = np.asarray(Image.open(out / name / f"{frame:04d}.png"))
            assert seen.shape == (48, 64) and set(np.unique(seen)) == {0, 255}, (seen.shape, np.unique(seen))
            columns = np.flatnonzero(seen.any(axis=0))
            assert abs(columns[0] - left - frame) <= 1 and 9 <= len(columns) <= 11, (name, frame, columns)


with tempfile.TemporaryDirectory() as temporary:
    if sys.argv[2:] == ["sam2"]:
        test_sam2(pathlib.Path(temporary))
    else:
        test_programs()
        test_dry_runs(pathlib.Path(temporary))
        test_names(pathlib.Path(temporary))
        test_fit(pathlib.Path(temporary))
        test_streams(pathlib.Path(temporary))
        test_end(pathlib.Path(temporary))
        test_example(pathlib.Path(temporary))
        test_kling(pathlib.Path(temporary))
        test_sora(pathlib.Path(temporary))
print("all hold")
