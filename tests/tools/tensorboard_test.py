"""The events of runs, read by a reader of its own: numbers, images and settings are those of the run's other files.

    python3 tests/tools/tensorboard_test.py HSI4D
"""

import json
import os
import pathlib
import signal
import struct
import subprocess
import sys
import tempfile
import time

program = pathlib.Path(sys.argv[1]).resolve()
stages = {
    "camera": {"iterations": 6, "draw": "scene", "weight": "unoccluded", "optimize": {"camera": {"lr": 0.004}},
               "losses": {"masked_l2": {}}},
    "interaction": {"iterations": 8, "optimize": {"transl": {"lr": 0.01}, "body_pose": {"lr": 0.01}},
                    "losses": {"photometric": {}, "center": {"weight": 0.001}}},
}
synthetic = {"frames": 4, "size_px": 48, "video": "png", "scene_gaussians": 1500, "avatar_gaussians": 500,
             "object_gaussians": 150}


# ---- The reader ----


def checksum(data):
    """CRC-32C, masked: bit by bit, as RFC 3720 defines it."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x82F63B78 if crc & 1 else 0)
    crc ^= 0xFFFFFFFF
    return ((crc >> 15 | crc << 17) + 0xA282EAD8) & 0xFFFFFFFF


def records(data):
    """The whole records of a file; what is cut short at its end is left out."""
    at = 0
    while len(data) - at >= 12:
        length, check = struct.unpack_from("<QI", data, at)
        assert check == checksum(data[at : at + 8]), f"length of the record at {at}"
        if len(data) - at < length + 16:
            return
        content = data[at + 12 : at + 12 + length]
        assert struct.unpack_from("<I", data, at + 12 + length)[0] == checksum(content), f"content of the record at {at}"
        yield content
        at += length + 16


def varint(data, at):
    value = shift = 0
    while True:
        value |= (data[at] & 0x7F) << shift
        shift += 7
        at += 1
        if data[at - 1] < 0x80:
            return value, at


def fields(data):
    """By number, the values of a message in their order: whole numbers and bytes."""
    found, at = {}, 0
    while at < len(data):
        tag, at = varint(data, at)
        kind = tag & 7
        if kind == 0:
            value, at = varint(data, at)
        else:
            size, at = {1: (8, at), 5: (4, at)}.get(kind) or varint(data, at)
            assert kind in (1, 2, 5) and at + size <= len(data), (kind, size)
            value, at = data[at : at + size], at + size
        found.setdefault(tag >> 3, []).append(value)
    return found


def double(data):
    return struct.unpack("<d", data)[0]


def setting(value):
    number, value = next(iter(fields(value).items()))
    return {2: double, 3: bytes.decode, 4: bool}[number](value[0])


def settings(metadata):
    plugin = fields(fields(metadata)[1][0])
    assert plugin[1] == [b"hparams"]
    start = fields(fields(plugin[2][0])[3][0])
    entries = [fields(entry) for entry in start[1]]
    return {entry[1][0].decode(): setting(entry[2][0]) for entry in entries}, double(start[5][0])


class Events:
    """What a file of events holds: scalars and images {tag: {step: value}}, settings, times."""

    def __init__(self, data):
        self.scalars, self.images, self.settings, self.times = {}, {}, None, []
        for index, record in enumerate(records(data)):
            event = fields(record)
            self.times.append(double(event[1][0]))
            if index == 0:
                assert event[3] == [b"brain.Event:2"], event
                continue
            for value in map(fields, fields(event[5][0])[1]):
                self.add(value[1][0].decode(), event[2][0], value)

    def add(self, tag, step, value):
        if tag == "_hparams_/session_start_info":
            self.settings, self.start = settings(value[9][0])
            return
        if 2 in value:
            kind, content = self.scalars, struct.unpack("<f", value[2][0])[0]
        else:
            image = fields(value[4][0])
            kind, content = self.images, (image[1][0], image[2][0], image[3][0], image[4][0])
        assert step not in kind.setdefault(tag, {}), (tag, step)
        kind[tag][step] = content


def events_of(run):
    files = list((run / "tensorboard").iterdir())
    assert len(files) == 1 and "tfevents" in files[0].name, files
    return files[0].read_bytes()


# ---- The checks ----


def as_float(value):
    return struct.unpack("<f", struct.pack("<f", value))[0]


def expected_scalars(run):
    """By tag and step, what the run's metrics.jsonl and summary.json say."""
    scalars = {}

    def add(tag, step, value):
        scalars.setdefault(tag, {})[step] = as_float(value)

    for step, line in enumerate(map(json.loads, (run / "metrics.jsonl").open())):
        add(f"loss/{line['stage']}", step, line["loss"])
        add(f"frame_loss/{line['stage']}", line["frame"], line["loss"])  # the last one stays
        for term, value in line["losses"].items():
            add(f"loss_{line['stage']}/{term}", step, value)
    summary = json.loads((run / "summary.json").read_text())
    for frame in summary["per_frame"]:
        for name, value in frame.items():
            if name != "frame":
                add(f"result/{name}", frame["frame"], value)
    for name, value in summary["metrics"][-1].items():
        if name not in ("stage", "seconds", "iterations", "gradient_shares"):
            add(f"mean/{name}", summary["frames"] - 1, value)
    return scalars


def check_run(run, frames_shown):
    events = Events(events_of(run))
    expected = expected_scalars(run)
    assert events.scalars.keys() == expected.keys(), events.scalars.keys() ^ expected.keys()
    assert events.scalars == expected
    assert sorted(events.images) == ["images/difference", "images/render", "images/target"], events.images.keys()
    for tag, images in events.images.items():
        assert sorted(images) == frames_shown, (tag, sorted(images))
        for step, (height, width, channels, png) in images.items():
            assert png == (run / "frames" / f"{step:04}_{tag.split('/')[1]}.png").read_bytes(), (tag, step)
            assert (height, width, channels) == (48, 48, 3), (tag, height, width, channels)
    assert events.times == sorted(events.times)
    seconds = sum(json.loads(line)["seconds"] for line in (run / "metrics.jsonl").open())
    assert abs(events.times[-1] - events.times[0] - seconds) < 1e-5
    return events


def run_program(*words):
    done = subprocess.run([str(program), *map(str, words)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def check_sweep():
    config = {"name": "events", "stages": stages, "synthetic": synthetic,
              "log": {"tensorboard": True, "images_every": 1}}
    pathlib.Path("base.json").write_text(json.dumps(config))
    grid = {"render.blur": [0.13, 0.25], "render.antialias": [True]}
    ablations = {"plain": {}, "less": {"stages.camera.iterations": 2}}
    pathlib.Path("sweep.json").write_text(
        json.dumps({"name": "events", "base": "base.json", "grid": grid, "ablations": ablations}))
    run_program("sweep", "sweep.json", "--out", "sweep", "--quiet")
    plan = json.loads(pathlib.Path("sweep/sweep.json").read_text())["runs"]
    assert len(plan) == 4
    told = []
    for entry in plan:
        events = check_run(pathlib.Path("sweep/runs") / entry["id"], [1, 2, 3])
        assert events.start == events.times[0]
        told.append(events.settings)
    expected = [{"ablation": a, "render.blur": b, "render.antialias": True} for a in ablations for b in grid["render.blur"]]
    assert sorted(told, key=str) == sorted(expected, key=str), told
    return pathlib.Path("sweep/runs") / plan[0]["id"]


def check_cut(run):
    """However much of a file is there, its whole records are read."""
    data = events_of(run)
    whole = list(records(data))
    assert sum(len(record) + 16 for record in whole) == len(data)
    ends, end = [], 0
    for record in whole:
        end += len(record) + 16
        ends.append(end)
    for cut in {0, 1, 11, 12, 39, *ends[:4], *(e - 1 for e in ends[:4]), *(e + 13 for e in ends[:4]), len(data) // 2}:
        found = list(records(data[:cut]))
        assert found == whole[: len(found)] and len(found) == sum(e <= cut for e in ends), cut
    broken = bytearray(data)
    broken[ends[1] + 20] ^= 1  # in the third record
    try:
        list(records(bytes(broken)))
    except AssertionError as error:
        assert str(error) == f"content of the record at {ends[1]}", error
    else:
        raise AssertionError("a record that is damaged was read")


def check_killed(dataset):
    """A run that was killed and resumed shows what one shows that never was."""
    words = ["run", dataset / "config.json", "--threads", "1", "--set", "log.tensorboard=true", "--set",
             "log.images_every=2", "--quiet", "--out"]
    run_program(*words, "whole")
    whole = check_run(pathlib.Path("whole"), [2])
    assert whole.settings is None
    killed = subprocess.Popen([str(program), *map(str, words), "killed"], stderr=subprocess.DEVNULL)
    lines = pathlib.Path("killed/metrics.jsonl")
    while killed.poll() is None and not (lines.exists() and '"frame": 2,' in lines.read_text()):
        time.sleep(0.005)
    killed.send_signal(signal.SIGKILL)
    killed.wait()
    Events(events_of(pathlib.Path("killed")))  # readable as it was left
    run_program(*words, "killed", "--resume")
    resumed = check_run(pathlib.Path("killed"), [2])
    assert resumed.scalars == whole.scalars and resumed.images == whole.images


with tempfile.TemporaryDirectory(prefix="hsi4d_events_") as folder:
    os.chdir(folder)
    first = check_sweep()
    check_cut(first)
    dataset = next(pathlib.Path("sweep/data").iterdir())
    config = json.loads((dataset / "config.json").read_text())
    config.update({"name": "killed", "stages": stages})
    (dataset / "config.json").write_text(json.dumps(config))
    check_killed(dataset)
    os.chdir("/")
print("events of 6 runs are those of their other files")
