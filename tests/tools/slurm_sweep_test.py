"""Sweeps on a cluster of Slurm with two nodes on this machine: one is lost in the middle, and times are over.

    python3 tests/tools/slurm_sweep_test.py TOOLS HSI4D CONFIGS [--keep DIR]

Exit status 77 (skipped, and said so) without Slurm, munge or root; tools/slurm-local install installs them.
"""

import argparse
import csv
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time

parser = argparse.ArgumentParser()
for word in ("tools", "program", "configs"):
    parser.add_argument(word, type=lambda text: pathlib.Path(text).resolve())
parser.add_argument("--keep", type=pathlib.Path, metavar="DIR")
arguments = parser.parse_args()
tools, program, configs = arguments.tools, arguments.program, arguments.configs
missing = [p for p in ("munged", "slurmctld", "slurmd", "sbatch") if shutil.which(p) is None]
if missing or os.geteuid() != 0:
    print("skipped: " + (f"there is no {', '.join(missing)} (tools/slurm-local install)" if missing else "not root"))
    sys.exit(77)

folder = arguments.keep or pathlib.Path(tempfile.mkdtemp(prefix="hsi4d_slurm_"))
cluster = folder / "cluster"
# Twelve runs are two arrays then.
environment = {**os.environ, "SLURM_CONF": str(cluster / "slurm.conf"), "SLURM_LOCAL_ARRAY": "9"}


def run(*words, check=True):
    done = subprocess.run([str(w) for w in words], env=environment, capture_output=True, text=True)
    if check and done.returncode != 0:
        raise SystemExit(f"{' '.join(map(str, words))} ended with {done.returncode}:\n{done.stdout}{done.stderr}")
    return done.stdout


def local(*words):
    return run(tools / "slurm-local", *words, cluster)


def wait_for(what, condition, seconds):
    begin = time.monotonic()
    while not condition():
        if time.monotonic() - begin > seconds:
            raise SystemExit(f"{what}: not within {seconds} s\n" + run("squeue") + run("sinfo", "-N"))
        time.sleep(0.5)
    print(f"{what}: after {time.monotonic() - begin:.0f} s", flush=True)


def attempts(sweep, run_id):
    file = sweep / "attempts" / f"{run_id}.jsonl"
    return [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []


def events(sweep, event):
    return [a for run_id in ids(sweep) for a in attempts(sweep, run_id) if a["event"] == event]


def ids(sweep):
    return [entry["id"] for entry in json.loads((sweep / "sweep.json").read_text())["runs"]]


def without_times(value):
    if isinstance(value, dict):
        return {key: without_times(entry) for key, entry in value.items() if key != "seconds"}
    return [without_times(entry) for entry in value] if isinstance(value, list) else value


def result(folder):
    """All of a run that must be the same wherever it was computed."""
    found = {str(f.relative_to(folder)): f.read_bytes() for f in sorted((folder / "frames").iterdir())}
    for name in ("motion.npz", "objects.npz", "cameras.json", "body.glb", "view3d.safetensors", "color_net.safetensors"):
        if (folder / name).exists():
            found[name] = (folder / name).read_bytes()
    found["metrics.jsonl"] = [without_times(json.loads(line)) for line in (folder / "metrics.jsonl").open()]
    found["summary.json"] = without_times(json.loads((folder / "summary.json").read_text()))
    return found


def check_same(sweep, other):
    assert ids(sweep) == ids(other)
    for run_id in ids(sweep):
        here, there = result(sweep / "runs" / run_id), result(other / "runs" / run_id)
        assert here.keys() == there.keys(), (run_id, here.keys() ^ there.keys())
        different = [name for name in here if here[name] != there[name]]
        assert not different, (run_id, different)
    print(f"{len(ids(sweep))} runs have the same bits in {sweep.name} and {other.name}", flush=True)


def check_once(sweep):
    for run_id in ids(sweep):
        done = [a for a in attempts(sweep, run_id) if a["event"] == "done"]
        assert len(done) == 1, (run_id, attempts(sweep, run_id))
        assert json.loads((sweep / "runs" / run_id / "status.json").read_text())["state"] == "done"
    with (sweep / "results.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["run"] for row in rows] == ids(sweep) and all(row["state"] == "done" for row in rows)
    assert len(list((sweep / "runs").iterdir())) == len(set(ids(sweep)))
    print(f"{sweep.name}: every result once; starts {[len([a for a in attempts(sweep, i) if a['event'] == 'start']) for i in ids(sweep)]}")


def queue_is_empty():
    return run("squeue", "--noheader").strip() == ""


def write_sweep(name, iterations=None, **more):
    smoke = json.loads((configs / "sweeps" / "smoke.json").read_text())
    if iterations is not None:
        smoke["set"]["stages.interaction.iterations"] = iterations
    for key in ("base", "clips"):
        value = smoke[key]
        smoke[key] = {k: str(configs / "sweeps" / v) for k, v in value.items()} if isinstance(value, dict) else str(configs / "sweeps" / value)
    smoke.update({"name": name, **more})
    smoke["set"].update(more.get("set", {}))
    path = folder / f"{name}.json"
    path.write_text(json.dumps(smoke, indent=2))
    return path


def smoke_is_the_same():
    sweep = write_sweep("smoke")
    run(program, "sweep", sweep, "--out", folder / "smoke_local")
    print(run(program, "sweep", sweep, "--out", folder / "smoke_slurm", "--launcher", "slurm").strip())
    wait_for("the smoke sweep", queue_is_empty, 300)
    check_once(folder / "smoke_slurm")
    check_same(folder / "smoke_local", folder / "smoke_slurm")


def lost_node():
    """Twelve runs; when both nodes compute, node2 is gone with all that it does."""
    sweep = write_sweep("lost", iterations=1200, seeds=6, slurm={"at_once": 4})  # long enough to be met in the middle
    run(program, "sweep", sweep, "--out", folder / "lost_local")
    print(run(program, "sweep", sweep, "--out", folder / "lost", "--launcher", "slurm").strip())

    def is_computing():
        on_node2 = run("squeue", "--noheader", "--states=R", "--nodelist=node2", "--format=%i").split()
        going = [i for i in ids(folder / "lost") if [a["event"] for a in attempts(folder / "lost", i)] == ["start"]]
        logs = [folder / "lost" / "runs" / i / "metrics.jsonl" for i in going]
        return len(on_node2) == 2 and len(going) == 4 and all(f.exists() and f.stat().st_size > 5000 for f in logs)

    wait_for("both nodes compute", is_computing, 200)
    interrupted = run("squeue", "--noheader", "--states=R", "--nodelist=node2", "--format=%i").split()
    local("kill-node", "node2")
    print(f"node2 is gone, with the runs {interrupted}", flush=True)
    done = len(events(folder / "lost", "done"))
    wait_for("the rest", queue_is_empty, 500)
    assert len(events(folder / "lost", "done")) == 12 and done < 12
    check_once(folder / "lost")
    starts = len(events(folder / "lost", "start"))
    assert 12 < starts <= 12 + len(interrupted), starts
    check_same(folder / "lost_local", folder / "lost")
    assert "nothing is left" in run(program, "sweep", sweep, "--out", folder / "lost", "--launcher", "slurm", "--resume")
    local("start-node", "node2")


def kinds_of(sweep, index):
    return [a["event"] for a in attempts(sweep, ids(sweep)[index])]


def warned_task():
    """Of three runs that compute, the last one is told that its time is up: it alone is queued again, and goes on."""
    sweep = write_sweep("warned", iterations=1200, seeds=3, ablations={"whole": {}})
    run(program, "sweep", sweep, "--out", folder / "warned_local")
    print(run(program, "sweep", sweep, "--out", folder / "warned", "--launcher", "slurm").strip())
    array = (folder / "warned" / "slurm" / "jobs.txt").read_text().split()[0]
    runs = [folder / "warned" / "runs" / i for i in ids(folder / "warned")]

    def has_frames():
        return all(list((r / "frames").glob("*")) for r in runs)

    wait_for("three runs have finished a frame", has_frames, 200)
    assert [kinds_of(folder / "warned", i) for i in range(3)] == [["start"]] * 3
    run("scancel", "--batch", "--signal=USR1", f"{array}_2")
    wait_for("the three runs", queue_is_empty, 300)
    assert [kinds_of(folder / "warned", i) for i in range(2)] == [["start", "done"]] * 2, kinds_of(folder / "warned", 0)
    assert kinds_of(folder / "warned", 2) == ["start", "interrupted", "start", "done"], kinds_of(folder / "warned", 2)
    check_once(folder / "warned")
    check_same(folder / "warned_local", folder / "warned")


def process_of(sweep):
    """The process that is, or is about to become, hsi4d with a run of this sweep; 0: none."""
    for entry in pathlib.Path("/proc").glob("[0-9]*"):
        try:
            words = (entry / "cmdline").read_bytes().split(b"\0")
        except OSError:  # it has ended
            continue
        if b"run-one" in words and str(sweep).encode() in words:
            return int(entry.name)
    return 0


def early_warning():
    """A warning in the first moment of a run does not kill it: the run says that it has had no time.

    slurmd sends it to the batch script's process; by scancel it would come too late for this.
    """
    sweep = write_sweep("early", seeds=1, ablations={"whole": {}})
    run(program, "sweep", sweep, "--out", folder / "early", "--launcher", "slurm")
    array = (folder / "early" / "slurm" / "jobs.txt").read_text().split()[0]
    begin = time.monotonic()
    while (process := process_of(folder / "early")) == 0:
        assert time.monotonic() - begin < 60
    time.sleep(0.005)  # env has blocked it, and hsi4d is being loaded
    os.kill(process, signal.SIGUSR1)
    wait_for("a run that is warned at its start", queue_is_empty, 100)
    noted = attempts(folder / "early", ids(folder / "early")[0])
    told = (folder / "early" / "slurm" / f"{array}_0.txt").read_text()
    assert noted and noted[-1]["event"] == "failed" and "before a frame was finished" in told, (noted, told)


def time_limit():
    """Of two runs, the one that needs more time than it has saves its state, is queued again by itself and goes on.

    Slurm warns up to a minute early, so a time of a minute and grace would leave none to compute in.
    """
    clip = folder / "clip.json"
    clip.write_text(json.dumps({"synthetic": {"frames": 60, "size_px": 128, "scene_gaussians": 4000, "avatar_gaussians": 2000}}))
    run(program, "synth", clip, "--out", folder / "clip")
    sweep = write_sweep("limit", seeds=1, ablations={"short": {"stages.interaction.iterations": 5, "stages.refinement": None}, "whole": {}},
                        clips={"clip": str(folder / "clip" / "config.json")},
                        set={"stages.interaction.iterations": 900}, slurm={"time": "00:02:00", "grace_s": 35})
    print(run(program, "sweep", sweep, "--out", folder / "limit", "--launcher", "slurm").strip())
    wait_for("a run of more than its time", queue_is_empty, 900)
    check_once(folder / "limit")
    limit = write_sweep("hopeless", seeds=1, ablations={"whole": {}}, clips={"clip": str(folder / "clip" / "config.json")},
                        set={"stages.interaction.iterations": 1000000}, slurm={"time": "00:02:00", "grace_s": 35})
    run(program, "sweep", limit, "--out", folder / "hopeless", "--launcher", "slurm")
    wait_for("a run that cannot finish a frame in its time", queue_is_empty, 300)
    told = "".join(f.read_text() for f in (folder / "hopeless" / "slurm").glob("*_0.txt"))
    assert "before a frame was finished, and would be again" in told, told
    noted = attempts(folder / "hopeless", ids(folder / "hopeless")[0])[-1]
    assert noted["event"] == "failed" and noted["message"] in told, noted
    kinds = kinds_of(folder / "limit", 1)
    assert kinds.count("interrupted") >= 1 and kinds[-1] == "done", kinds
    short = "".join(f.read_text() for f in (folder / "limit" / "slurm").glob("*_0.txt"))
    assert short.count("report: ") == 1, short  # once done it is not started again
    print("the run's attempts: " + ", ".join(kinds))


try:
    print(local("start").strip())
    smoke_is_the_same()
    lost_node()
    warned_task()
    early_warning()
    time_limit()
    print("passed")
finally:
    local("stop")
    if not arguments.keep:
        shutil.rmtree(folder, ignore_errors=True)
