#!/usr/bin/env python3
"""Makes a video of an image by KLING's service, for /sources/video of a config.

    "command": ["tools/services/kling.py", "--image", "{first_frame}", "--prompt={prompt}", "--out", "{out}",
                "--tasks", "generated/tasks"]

The account's keys are in the environment, KLING_ACCESS_KEY and KLING_SECRET_KEY. A task costs money when it is
accepted; with --tasks its number is kept in a file there until its video has arrived, so that after a lost connection or
a run that was ended the same request goes on with the task that is paid for. One that the service no longer knows (it
keeps videos for a while) is told of and asked for anew.

Exit status 75 (hsi4d tries again): no connection, too many requests, the service's own errors. Written after the public
description of the service (POST and GET /v1/videos/image2video) and tried against a stand-in of it only.
"""

import base64
import hashlib
import hmac
import http.client
import json
import os
import pathlib
import sys
import tempfile
import time
import urllib.error
import urllib.request

import service


def encoded(data):
    return base64.urlsafe_b64encode(data).rstrip(b"=")


def token(access_key, secret_key, now):
    """A JSON web token signed by HS256, good for half an hour."""
    head = encoded(json.dumps({"alg": "HS256", "typ": "JWT"}).encode())
    claims = encoded(json.dumps({"iss": access_key, "exp": now + 1800, "nbf": now - 5}).encode())
    signed = head + b"." + claims
    return (signed + b"." + encoded(hmac.new(secret_key.encode(), signed, hashlib.sha256).digest())).decode()


class Kling:
    def __init__(self, url):
        self.url = url.rstrip("/") + "/v1/videos/image2video"
        self.keys = [os.environ.get(name, "") for name in ("KLING_ACCESS_KEY", "KLING_SECRET_KEY")]
        if not all(self.keys):
            service.fail("KLING_ACCESS_KEY and KLING_SECRET_KEY have to be in the environment", service.ASKED_WRONGLY)

    def ask(self, place="", body=None):
        """The member `data` of an answer."""
        head = {"Authorization": "Bearer " + token(*self.keys, int(time.time())), "Content-Type": "application/json"}
        content = None if body is None else json.dumps(body).encode()
        answer = fetched(urllib.request.Request(self.url + place, data=content, headers=head))
        try:
            told = json.loads(answer)
        except ValueError:
            service.fail("the service's answer is no JSON", service.TRY_AGAIN)
        if told.get("code") != 0:
            service.fail(f"the service refuses: {told.get('code')} {told.get('message')}")
        return told["data"]


class Gone(Exception):
    """The service does not know what it is asked for, or no more."""


def fetched(request):
    try:
        with urllib.request.urlopen(request, timeout=120) as answer:
            return answer.read()
    except urllib.error.HTTPError as error:
        told = error.read(400).decode(errors="replace")
        if error.code in (404, 410):
            raise Gone(f"the service answers {error.code}: {told}") from error
        is_temporary = error.code == 429 or error.code >= 500
        service.fail(f"the service answers {error.code}: {told}", service.TRY_AGAIN if is_temporary else service.FAILED)
    except (OSError, http.client.HTTPException) as error:  # the latter: an answer that breaks off
        service.fail(f"no connection: {error}", service.TRY_AGAIN)


def waited(kling, task, seconds):
    """The address of a task's video."""
    while True:
        told = kling.ask("/" + task)
        if told["task_status"] == "succeed":
            return told["task_result"]["videos"][0]["url"]
        if told["task_status"] == "failed":
            return None
        time.sleep(seconds)


class KeptTask:
    """The number of a task that is paid for, in a file until its video has arrived; in no file without a folder."""

    def __init__(self, folder, body):
        self.file = None
        if folder:
            name = hashlib.sha256(json.dumps(body).encode()).hexdigest()[:16] + ".task"
            self.file = pathlib.Path(folder) / name
            self.file.parent.mkdir(parents=True, exist_ok=True)

    def read(self):
        return self.file.read_text(encoding="utf-8").strip() if self.file and self.file.exists() else ""

    def write(self, task):
        """In one step: half a number would be another task."""
        if self.file:
            new = self.file.with_suffix(f".{os.getpid()}.tmp")
            new.write_text(task + "\n", encoding="utf-8")
            os.replace(new, self.file)

    def forget(self):
        if self.file:
            self.file.unlink(missing_ok=True)


def video_of(kling, task, kept, seconds):
    """What a task has made, MP4. Raises Gone."""
    url = waited(kling, task, seconds)
    if url is None:
        kept.forget()
        service.fail(f"task {task} has failed")
    return fetched(urllib.request.Request(url))


def main():
    parser = service.Parser(__doc__)
    parser.add_argument("--image", required=True, help="the first frame, a PNG file")
    parser.add_argument("--prompt", required=True, help="as --prompt=TEXT, which may then begin with a -")
    parser.add_argument("--out", required=True, help="the video to write, an MP4 file")
    parser.add_argument("--model", default="kling-v1-6")
    parser.add_argument("--mode", default="std", choices=["std", "pro"])
    parser.add_argument("--duration", default="5", choices=["5", "10"], help="seconds")
    parser.add_argument("--cfg", type=float, default=0.5, help="how closely it follows the text, 0 to 1")
    parser.add_argument("--tasks", help="a folder that keeps numbers of tasks under way")
    parser.add_argument("--poll", type=float, default=10, help="seconds between two looks at a task")
    parser.add_argument("--url", default="https://api.klingai.com")
    a = parser.parse_args()

    image = base64.b64encode(service.need(a.image, "image").read_bytes()).decode()
    body = {"model_name": a.model, "mode": a.mode, "duration": a.duration, "cfg_scale": a.cfg, "prompt": a.prompt,
            "image": image}
    if a.dry_run:
        print(f"POST {a.url}/v1/videos/image2video " + json.dumps({**body, "image": f"{len(image)} characters"}))
        return
    kling = Kling(a.url)
    kept = KeptTask(a.tasks, body)
    task = kept.read()
    video = None
    if task:
        try:
            video = video_of(kling, task, kept, a.poll)
        except Gone as error:
            kept.forget()
            print(f"kling.py: task {task}, which was paid for, is gone, and a new one is asked for: {error}", file=sys.stderr)
    if video is None:
        try:
            task = kling.ask(body=body)["task_id"]
            kept.write(task)
            video = video_of(kling, task, kept, a.poll)
        except Gone as error:
            service.fail(str(error))
    with tempfile.TemporaryDirectory() as folder:
        made = pathlib.Path(folder) / "video.mp4"
        made.write_bytes(video)
        service.fit_video(made, a.image, a.out)
    kept.forget()


if __name__ == "__main__":
    main()
