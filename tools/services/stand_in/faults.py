"""What goes wrong with services, to be tried with the stand-ins: statuses, hangs, outputs that are missing."""

import pathlib
import sys
import time


def add_options(parser):
    parser.add_argument("--fail", type=int, metavar="STATUS", help="end with this exit status")
    parser.add_argument("--fail-first", type=int, metavar="N", help="--fail only the first N times, counted in --count")
    parser.add_argument("--hang", action="store_true", help="never end; with --fail-first the first times")
    parser.add_argument("--empty", action="store_true", help="write nothing; with --fail-first the first times")
    parser.add_argument("--count", metavar="F", help="a file that gets a line each time this is run")


def times_run(path):
    """How often a stand-in was run, this time included."""
    if path is None:
        return 1
    with open(path, "a", encoding="utf-8") as file:
        file.write("run\n")
    return len(pathlib.Path(path).read_text(encoding="utf-8").splitlines())


def apply(arguments):
    """Does what goes wrong this time."""
    times = times_run(arguments.count)
    if arguments.fail_first is not None and times > arguments.fail_first:
        return
    if arguments.hang:
        print("waits for ever", flush=True)
        time.sleep(7 * 24 * 3600)
    if arguments.fail is not None:
        print(f"fails on purpose, time {times}", file=sys.stderr)
        sys.exit(arguments.fail)
    if arguments.empty:
        sys.exit(0)
