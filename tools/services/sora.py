#!/usr/bin/env python3
"""Makes a video of an image by Sora over OpenAI's service, for /sources/video of a config.

    "command": ["tools/services/sora.py", "--image", "{first_frame}", "--prompt={prompt}", "--seed", "{seed}",
                "--out", "{out}", "--tasks", "generated/tasks"]

The account's key is in the environment, OPENAI_API_KEY. The service takes images of the sizes that its videos have, such
as 1280 x 720 and 720 x 1280: data.camera has to be of one. Tasks and --tasks are as in kling.py. A service of the same
kind elsewhere has another --url.

Exit status 75 (hsi4d tries again): no connection, too many requests, the service's own errors. Written after the public
description of the service (POST /v1/videos, GET /v1/videos/ID and /v1/videos/ID/content) and tried against a stand-in of
it only.
"""

import hashlib
import json

import service
import web_task


def form(fields, image):
    """The content type and body of a form (multipart/form-data) with a PNG file."""
    edge = "hsi4d-" + hashlib.sha256(image).hexdigest()[:24]
    parts = [f'--{edge}\r\nContent-Disposition: form-data; name="{name}"\r\n\r\n{value}\r\n'.encode() for name, value in fields.items()]
    parts.append(f'--{edge}\r\nContent-Disposition: form-data; name="input_reference"; filename="first.png"\r\n'
                 "Content-Type: image/png\r\n\r\n".encode())
    return f"multipart/form-data; boundary={edge}", b"".join([*parts, image, f"\r\n--{edge}--\r\n".encode()])


class Sora:
    reason = ""

    def __init__(self, url, fields, image):
        self.url, self.fields, self.image = url.rstrip("/") + "/v1/videos", fields, image
        (self.key,) = web_task.keys_of("OPENAI_API_KEY")

    def request(self, place="", body=None, kind=None):
        return web_task.with_key(self.url + place, self.key, body, kind)

    def begin(self):
        kind, body = form(self.fields, self.image)
        return web_task.fetched_json(self.request(body=body, kind=kind))["id"]

    def look(self, task):
        told = web_task.fetched_json(self.request("/" + task))
        if told["status"] in ("queued", "in_progress"):
            return web_task.RUNNING
        self.reason = (told.get("error") or {}).get("message") or told["status"]
        return web_task.DONE if told["status"] == "completed" else web_task.FAILED

    def content(self, task):
        return web_task.fetched(self.request(f"/{task}/content"))


def main():
    parser = service.Parser(__doc__)
    web_task.add_arguments(parser, "https://api.openai.com")
    parser.add_argument("--model", default="sora-2")
    parser.add_argument("--seconds", default="4", help="4, 8 or 12")
    a = parser.parse_args()

    image = service.need(a.image, "image")
    width, height = service.png_size(image)
    fields = {"model": a.model, "prompt": a.prompt, "seconds": a.seconds, "size": f"{width}x{height}"}
    if a.dry_run:
        print(f"POST {a.url}/v1/videos " + json.dumps(fields))
        return
    content = image.read_bytes()
    web_task.write_video(Sora(a.url, fields, content), a, [fields, hashlib.sha256(content).hexdigest()])


if __name__ == "__main__":
    main()
