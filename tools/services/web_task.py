"""What services over the network have in common: a task costs money when it is accepted, so its number is kept until
its video has arrived. After a lost connection or a run that was ended, the same request goes on with that task.

Exit status 75 (hsi4d tries again): no connection, too many requests, the service's own errors.
"""

import hashlib
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


RUNNING, DONE, FAILED = "running", "done", "failed"  # states of a task


class Gone(Exception):
    """The service does not know what it is asked for, or no more."""


def fetched(request):
    """The content of an answer. Raises Gone."""
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


def fetched_json(request):
    """As fetched, of an answer that is JSON."""
    try:
        return json.loads(fetched(request))
    except ValueError:
        service.fail("the service's answer is no JSON", service.TRY_AGAIN)


def with_key(url, bearer, data=None, kind=None):
    """A request with a key, which does not follow to another address that the service names."""
    request = urllib.request.Request(url, data=data, headers={"Content-Type": kind} if kind else {})
    request.add_unredirected_header("Authorization", "Bearer " + bearer)
    return request


def keys_of(*names):
    """Keys of an account, from the environment."""
    keys = [os.environ.get(name, "") for name in names]
    if not all(keys):
        service.fail(f"{' and '.join(names)} {'has' if len(names) == 1 else 'have'} to be in the environment", service.ASKED_WRONGLY)
    return keys


def add_arguments(parser, url):
    parser.add_argument("--image", required=True, help="the first frame, a PNG file")
    parser.add_argument("--prompt", required=True, help="as --prompt=TEXT, which may then begin with a -")
    parser.add_argument("--out", required=True, help="the video to write, an MP4 file")
    parser.add_argument("--seed", type=int, default=0,
                        help="the service takes none; another number is another task, and with it another video")
    parser.add_argument("--tasks", help="a folder that keeps numbers of tasks under way")
    parser.add_argument("--poll", type=float, default=10, help="seconds between two looks at a task")
    parser.add_argument("--url", default=url)


class KeptTask:
    """The number of a task that is paid for, in a file until its video has arrived; in no file without a folder."""

    def __init__(self, folder, request):
        self.file = None
        if folder:
            name = hashlib.sha256(json.dumps(request).encode()).hexdigest()[:16] + ".task"
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


def waited_for(web, task, kept, seconds):
    """What a task has made, MP4. Raises Gone."""
    while True:
        state = web.look(task)
        if state == DONE:
            return web.content(task)
        if state == FAILED:
            kept.forget()
            service.fail(f"task {task} has failed" + (f": {web.reason}" if web.reason else ""))
        time.sleep(seconds)


def made_video(web, kept, seconds):
    """The video of a task that is under way, or of a new one.

    @param web  the service: begin() gives a task's number, look(task) its state; then content(task) the video, `reason`
                why it failed
    """
    task = kept.read()
    if task:
        try:
            return waited_for(web, task, kept, seconds)
        except Gone as error:
            kept.forget()
            print(f"{pathlib.Path(sys.argv[0]).name}: task {task}, which was paid for, is gone, and a new one is asked for: {error}",
                  file=sys.stderr)
    try:
        task = web.begin()
        kept.write(task)
        return waited_for(web, task, kept, seconds)
    except Gone as error:
        service.fail(str(error))


def write_video(web, arguments, request):
    """Makes the video, as large as the image, and forgets the task."""
    kept = KeptTask(arguments.tasks, [arguments.url, request, arguments.seed])
    try:
        video = made_video(web, kept, arguments.poll)
    except (KeyError, IndexError, TypeError, AttributeError, ValueError) as error:
        service.fail(f"the service's answer is not as its description has it: {error!r}")
    with tempfile.TemporaryDirectory() as folder:
        made = pathlib.Path(folder) / "video.mp4"
        made.write_bytes(video)
        service.fit_video(made, arguments.image, arguments.out)
    kept.forget()
