"""Figures that need many runs or a clock, kept as CSV in measured/ so that drawing them gives the same bytes."""

import csv
import os
import subprocess

import runs

FOLDER = os.path.join(os.path.dirname(__file__), "measured")


def write(name, header, rows):
    with open(os.path.join(FOLDER, name), "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)


def draws():
    """48 replays, some six minutes."""
    rows = []
    for (log, cameras), errors in runs.draws().items():
        rows += [(log, cameras, features, f"{error:.4f}") for features, error in zip(runs.DRAWS, errors)]
    write("draws.csv", ("log", "cameras", "max_features", "ate_m"), rows)


def latency():
    """CPU time from images to pose of the default runs, pooled. Other work on the machine makes it longer."""
    counts = {}
    for log in runs.DRAWN_LOGS:
        for kind, times in runs.summary(runs.default_run(log))["timing"]["image_to_pose"].items():
            for entry in times["cpu"]["histogram"].split(", "):
                lower, count = entry.split()
                counts[kind, float(lower)] = counts.get((kind, float(lower)), 0) + int(count)
    write("latency.csv", ("kind", "from_ms", "count"), [(*key, count) for key, count in sorted(counts.items())])


def loop_selection():
    """Needs benchmark_loop_selection beside the program's build (-DSWIFTLET_BUILD_BENCHMARKS=ON)."""
    program = os.path.join(os.path.dirname(runs.SWIFTLET), "../tests/benchmark/benchmark_loop_selection")
    done = subprocess.run([program], stdout=subprocess.PIPE, text=True, check=True)
    with open(os.path.join(FOLDER, "loop_selection.csv"), "w") as file:
        file.write(done.stdout)


def measure(names):
    known = {"draws": draws, "latency": latency, "loop_selection": loop_selection}
    for name in names or known:
        if name not in known:
            raise SystemExit(f"figures: --measure knows {', '.join(known)}")
        known[name]()
