#!/usr/bin/env python3
"""What ROS 2's topics cost the flight path: paired runs of one log in real time, alternating

  without   no ROS 2
  killed    a subscriber of another make reads all topics and is killed in the middle
  flooded   a labeller answers each mapped image after 0.3 s and floods the label topic with 1000 images/s

For each stage of the flight path: the 99th percentile of its CPU (and wall) time with, over without; the median of
all pairs. All runs compute the state at every IMU sample (--imu-rate), as those with ROS 2 do.
usage: tests/benchmark/ros2_beside_flight.py LOG [PAIRS]   (default 5; run from the project's root)
Needs build/release with SWIFTLET_WITH_DDS and the tests. Exit code 1 where the median of the CPU time of image to
pose, tracking, smoothing, mesh or sample to state is above 1.15.
"""
import json
import pathlib
import signal
import statistics
import subprocess
import sys
import tempfile
import time

BUILD = pathlib.Path("build/release")
PEERS = BUILD / "tests/drivers/dds"
DOMAIN = 97
STAGES = [(stage, kind) for stage in ("image_to_pose", "track", "smooth", "mesh") for kind in ("frames", "keyframes")]
STAGES += [("imu", "all")]
MOST = 1.15


def replay(log, out, settings):
    command = [BUILD / "bin/swiftlet", "replay", log, "--real-time", "--map", "--imu-rate", "--out", out]
    for setting in settings:
        command += ["--set", setting]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def run(kind, log, out):
    settings, peer = [], None
    if kind != "without":
        settings = ["ros2.enabled=true", f"ros2.domain={DOMAIN}"]
    if kind == "killed":
        peer = [PEERS / "dds_subscriber", "600", str(DOMAIN)]
    if kind == "flooded":
        settings += ["ros2.label_topic=/segmentation/labels"]
        peer = [PEERS / "dds_labeller", f"domain={DOMAIN}", "delay=0.3", "label=5", "flood=1000"]
    if peer:
        peer = subprocess.Popen(peer, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    program = replay(log, out, settings)
    if kind == "killed":
        time.sleep(10)
        peer.send_signal(signal.SIGKILL)
    if program.wait() != 0:
        sys.exit(f"ros2_beside_flight: swiftlet replay failed ({kind})")
    said = ""
    if peer:
        said = peer.communicate()[0].strip()
    summary = json.loads((out / "summary.json").read_text())
    if kind != "without":
        print(f"  {kind}: {json.dumps(summary['executor']['ros2'])} {said if kind == 'flooded' else ''}", flush=True)
    return summary


def main():
    if not 2 <= len(sys.argv) <= 3:
        sys.exit(__doc__)
    log, pairs = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 5
    kinds = ["without", "killed", "flooded"]
    p99 = {}  # (kind, stage, clock): one figure a round
    lost = {kind: 0 for kind in kinds}
    with tempfile.TemporaryDirectory() as scratch:
        for pair in range(pairs):
            # Whoever goes first has the machine as the round before left it.
            for kind in kinds[pair % 3:] + kinds[:pair % 3]:
                summary = run(kind, log, pathlib.Path(scratch) / kind)
                lost[kind] += summary["counters"]["odometry"]["frames_dropped"]
                for stage in STAGES:
                    for clock in ("cpu", "wall"):
                        figure = summary["timing"][stage[0]][stage[1]][clock]["p99_ms"]
                        p99.setdefault((kind, stage, clock), []).append(figure)
            print(f"pair {pair + 1} of {pairs}", flush=True)
    failed = False
    print(f"99th percentile [ms], median of {pairs}; in brackets the median of the ratios to the run without")
    for clock in ("cpu", "wall"):
        for stage in STAGES:
            without = p99["without", stage, clock]
            line = f"{clock:4} {' '.join(stage):23} {statistics.median(without):8.4f}"
            for kind in kinds[1:]:
                figures = p99[kind, stage, clock]
                ratio = statistics.median(a / b for a, b in zip(figures, without))
                failed |= clock == "cpu" and ratio > MOST
                line += f"   {kind} {statistics.median(figures):8.4f} ({ratio:.2f})"
            print(line)
    print("frames dropped:", lost)
    sys.exit(1 if failed else 0)


main()
