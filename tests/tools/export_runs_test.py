"""What tools/export_runs writes, read by a reader of its own: that of MLflow's file store, as its pages describe it.

    python3 tests/tools/export_runs_test.py TOOLS
"""

import json
import pathlib
import subprocess
import sys
import tempfile

TOOL = pathlib.Path(sys.argv[1]) / "export_runs"


# ---- The reader ----


def yaml_of(path):
    """Lines of scalars, as meta.yaml has them."""
    fields = {}
    for line in path.read_text().splitlines():
        key, text = line.split(":", 1)
        text = text.strip()
        try:
            fields[key] = json.loads(text)
        except ValueError:
            fields[key] = text
    return fields


def files_of(folder):
    return {path.relative_to(folder).as_posix(): path.read_text() for path in folder.rglob("*") if path.is_file()}


class Store:
    def __init__(self, root):
        self.experiments = {}
        for folder in root.iterdir():
            meta = yaml_of(folder / "meta.yaml")
            assert meta["experiment_id"] == folder.name and meta["lifecycle_stage"] == "active", meta
            runs = [path for path in folder.iterdir() if path.is_dir()]
            self.experiments[meta["name"]] = {run["meta"]["run_name"]: run for run in map(self.run, runs)}

    @staticmethod
    def run(folder):
        meta = yaml_of(folder / "meta.yaml")
        assert meta["run_id"] == meta["run_uuid"] == folder.name and len(folder.name) == 32, meta
        assert meta["experiment_id"] == folder.parent.name, meta
        metrics = {}
        for name, text in files_of(folder / "metrics").items():
            rows = [line.split(" ") for line in text.splitlines()]
            metrics[name] = [(int(at), float(value), int(step)) for at, value, step in rows]
        return {"meta": meta, "params": files_of(folder / "params"), "metrics": metrics, "tags": files_of(folder / "tags"),
                "artifacts": files_of(folder / "artifacts")}


# ---- Runs ----


def make_run(folder, state="done"):
    folder.mkdir(parents=True)
    status = {"state": state, "started": "2026-05-01T12:00:00Z", "version": "0.1.0", "git": "abc"}
    config = {"name": "walk", "stages": {"camera": {"iterations": 2, "losses": {"masked_l2": {"weight": 1.5}}}}, "chain": [],
              "render": {"antialias": False}}
    lines = [{"frame": 1, "stage": "camera", "iteration": 0, "loss": 0.25, "losses": {"masked_l2": 0.5}, "seconds": 0.5},
             {"frame": 1, "stage": "camera", "iteration": 1, "loss": None, "losses": {"masked_l2": None}, "seconds": 0.25},
             {"frame": 2, "stage": "camera", "iteration": 0, "loss": 0.1, "losses": {"masked_l2": 1e-17}, "seconds": 0.25}]
    summary = {"metrics": [{"stage": "camera", "psnr_db": 20}, {"stage": "all", "psnr_db": 31.5}],
               "per_frame": [{"frame": 1, "psnr_db": 30}, {"frame": 2, "psnr_db": 33}]}
    (folder / "status.json").write_text(json.dumps(status))
    (folder / "config.resolved.json").write_text(json.dumps(config))
    (folder / "metrics.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    (folder / "summary.json").write_text(json.dumps(summary))
    return folder


def run_tool(*arguments):
    return subprocess.run([sys.executable, TOOL, *map(str, arguments)], capture_output=True, text=True)


def export(*arguments):
    result = run_tool(*arguments)
    assert result.returncode == 0, result.stderr
    return result.stdout


def refused(words, *arguments):
    result = run_tool(*arguments)
    assert result.returncode == 2 and words in result.stderr, (result.returncode, result.stderr)


with tempfile.TemporaryDirectory() as base:
    base = pathlib.Path(base)
    out = base / "mlruns"
    one = make_run(base / "one")
    make_run(base / "sweep/runs/a", state="failed")
    make_run(base / "sweep/runs/b")
    export(one, "--out", out)
    export(base / "sweep", "--out", out, "--experiment", "sweep, all")

    begin = 1777636800000  # 2026-05-01 12:00 UTC, milliseconds
    store = Store(out)
    assert set(store.experiments) == {"hsi4d", "sweep, all"}, store.experiments
    run = store.experiments["hsi4d"]["one"]
    assert run["meta"]["status"] == 3 and run["meta"]["start_time"] == begin and run["meta"]["end_time"] == begin + 1000
    assert run["params"] == {"name": "walk", "stages.camera.iterations": "2", "stages.camera.losses.masked_l2.weight": "1.5",
                             "chain": "[]", "render.antialias": "false"}, run["params"]
    assert run["metrics"] == {
        "loss/camera": [(begin + 500, 0.25, 0), (begin + 1000, 0.1, 2)],
        "loss_camera/masked_l2": [(begin + 500, 0.5, 0), (begin + 1000, 1e-17, 2)],
        "result/psnr_db": [(begin + 1000, 30, 1), (begin + 1000, 33, 2)],
        "mean/psnr_db": [(begin + 1000, 31.5, 0)]}, run["metrics"]
    assert run["tags"]["mlflow.runName"] == "one" and run["tags"]["mlflow.source.git.commit"] == "abc", run["tags"]
    assert set(run["artifacts"]) == {"summary.json", "config.resolved.json"}
    assert run["artifacts"]["summary.json"] == (one / "summary.json").read_text()
    sweep = store.experiments["sweep, all"]
    assert {name: of["meta"]["status"] for name, of in sweep.items()} == {"runs/a": 4, "runs/b": 3}, sweep

    # The same run again is the same run, as it is by now.
    (one / "summary.json").unlink()
    export(one, "--out", out)
    store = Store(out)
    assert set(store.experiments["hsi4d"]["one"]["metrics"]) == {"loss/camera", "loss_camera/masked_l2"}
    assert len(store.experiments["hsi4d"]) == 1 and len(store.experiments["sweep, all"]) == 2

    (base / "empty").mkdir()
    refused("empty: is no run of hsi4d, nor a folder with some", base / "empty", "--out", out)
    refused("nothing: is no run of hsi4d", base / "nothing", "--out", out)
    refused("is no name", one, "--out", out, "--experiment", " ")
    (one / "metrics.jsonl").write_text('{"stage": "camera"}\n')
    refused("metrics.jsonl:1: is no line of a run", one, "--out", out)
    make_run(base / "odd", state="asleep")
    refused("/state: 'asleep'; allowed: running, done, failed, interrupted", base / "odd", "--out", out)
    (one / "status.json").write_text('{"state": "done", "started": "noon"}')
    refused("'noon' is no time like 2024-05-01T12:00:00Z", one, "--out", out)
    assert not [path for path in out.rglob("*.tmp")], "something is left half done"
