#!/usr/bin/env python3
"""Makes a video of an image by KLING's service, for /sources/video of a config.

    "command": ["tools/services/kling.py", "--image", "{first_frame}", "--prompt={prompt}", "--seed", "{seed}",
                "--out", "{out}", "--tasks", "generated/tasks"]

The account's keys are in the environment, KLING_ACCESS_KEY and KLING_SECRET_KEY. A task costs money when it is
accepted; with --tasks its number is kept in a file there until its video has arrived, so that after a lost connection or
a run that was ended the same request goes on with the task that is paid for. One that the service no longer knows (it
keeps videos for a while) is told of and asked for anew.

--url is the address of the account's region: https://api.klingai.com, https://api-singapore.klingai.com or
https://api-beijing.klingai.com. Keys of one are not those of another. The default model is the first, 1.0, which the
paper has.

Exit status 75 (hsi4d tries again): no connection, too many requests, the service's own errors. Written after the public
description of the service (POST and GET /v1/videos/image2video) and tried against a stand-in of it only.
"""

import base64
import hashlib
import hmac
import json
import time
import urllib.request

import service
import web_task


def encoded(data):
    return base64.urlsafe_b64encode(data).rstrip(b"=")


def token(access_key, secret_key, now):
    """A JSON web token signed by HS256, good for half an hour."""
    head = encoded(json.dumps({"alg": "HS256", "typ": "JWT"}).encode())
    claims = encoded(json.dumps({"iss": access_key, "exp": now + 1800, "nbf": now - 5}).encode())
    signed = head + b"." + claims
    return (signed + b"." + encoded(hmac.new(secret_key.encode(), signed, hashlib.sha256).digest())).decode()


class Kling:
    reason = ""

    def __init__(self, url, body):
        self.url, self.body, self.videos = url.rstrip("/") + "/v1/videos/image2video", body, {}
        self.keys = web_task.keys_of("KLING_ACCESS_KEY", "KLING_SECRET_KEY")

    def ask(self, place="", body=None):
        """The member `data` of an answer."""
        content = None if body is None else json.dumps(body).encode()
        bearer = token(*self.keys, int(time.time()))
        told = web_task.fetched_json(web_task.with_key(self.url + place, bearer, content, "application/json"))
        if told.get("code") != 0:
            service.fail(f"the service refuses: {told.get('code')} {told.get('message')}")
        return told["data"]

    def begin(self):
        return self.ask(body=self.body)["task_id"]

    def look(self, task):
        told = self.ask("/" + task)
        if told["task_status"] in ("submitted", "processing"):
            return web_task.RUNNING
        if told["task_status"] != "succeed":
            self.reason = told.get("task_status_msg") or told["task_status"]
            return web_task.FAILED
        self.videos[task] = told["task_result"]["videos"][0]["url"]
        return web_task.DONE

    def content(self, task):
        return web_task.fetched(urllib.request.Request(self.videos[task]))


def main():
    parser = service.Parser(__doc__)
    web_task.add_arguments(parser, "https://api.klingai.com")
    parser.add_argument("--model", default="kling-v1", help="kling-v1 (1.0), kling-v1-5, kling-v1-6, ...")
    parser.add_argument("--mode", default="std", choices=["std", "pro"])
    parser.add_argument("--duration", default="5", choices=["5", "10"], help="seconds")
    parser.add_argument("--cfg", type=float, default=0.5, help="how closely it follows the text, 0 to 1")
    a = parser.parse_args()

    image = base64.b64encode(service.need(a.image, "image").read_bytes()).decode()
    body = {"model_name": a.model, "mode": a.mode, "duration": a.duration, "cfg_scale": a.cfg, "prompt": a.prompt,
            "image": image}
    if a.dry_run:
        print(f"POST {a.url}/v1/videos/image2video " + json.dumps({**body, "image": f"{len(image)} characters"}))
        return
    web_task.write_video(Kling(a.url, body), a, body)


if __name__ == "__main__":
    main()
