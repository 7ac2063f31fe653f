"""The runs that figures are drawn from: made when one is needed, kept in the work folder, and read."""

import csv
import json
import os
import shutil
import struct
import subprocess

import numpy as np

ROOT = os.path.abspath(os.path.join(os.path.dirname(__file__), "..", ".."))
SWIFTLET = os.path.abspath(os.environ.get("SWIFTLET", os.path.join(ROOT, "build/release/bin/swiftlet")))
DATA = os.path.abspath(os.environ.get("SWIFTLET_DATA", os.path.join(ROOT, "../shared/data")))
WORK = os.path.abspath(os.environ.get("FIGURES_WORK", os.path.join(ROOT, "build/figures")))

DRAWN_LOGS = ("euroc_mh01_20s", "vil_v102", "vil_mh05")
# Numbers of features, near the default of 300: each gives another draw of the same error.
DRAWS = range(292, 308, 2)


def log_folder(name):
    """A recorded log of SWIFTLET_DATA."""
    path = os.path.join(DATA, name)
    if not os.path.isdir(path):
        raise SystemExit(f"figures: {path} is missing; SWIFTLET_DATA names the folder of logs")
    return path


def swiftlet(*arguments, ok=(0,)):
    """Runs the program; its output goes to WORK/swiftlet.log."""
    if not os.access(SWIFTLET, os.X_OK):
        raise SystemExit(f"figures: {SWIFTLET} is missing; build it or name the program with SWIFTLET")
    os.makedirs(WORK, exist_ok=True)
    with open(os.path.join(WORK, "swiftlet.log"), "a") as log:
        log.write("$ swiftlet " + " ".join(arguments) + "\n")
        log.flush()
        done = subprocess.run([SWIFTLET, *arguments], stdout=log, stderr=log, cwd=WORK, check=False)
    if done.returncode not in ok:
        raise SystemExit(f"figures: swiftlet {' '.join(arguments)} failed; see {WORK}/swiftlet.log")


def made(name, make):
    """WORK/name, made by make(folder.part) unless it is there."""
    folder = os.path.join(WORK, name)
    if not os.path.exists(folder):
        part = folder + ".part"
        shutil.rmtree(part, ignore_errors=True)
        make(part)
        os.rename(part, folder)
    return folder


def replayed(name, log, *options):
    return made(name, lambda out: swiftlet("replay", log, "--out", out, *options))


def default_run(log):
    """Two cameras, default settings."""
    return replayed(log, log_folder(log))


def v102():
    return replayed("v102", log_folder("vil_v102"), "--map", "--loop-closure", "--mesh-sequence")


def twin_flight():
    """60 s through two rooms that look the same, rendered (toolchain/revisit_flights.sh)."""

    def make(part):
        environment = dict(os.environ, SWIFTLET=SWIFTLET, SWIFTLET_DATA=DATA)
        subprocess.run(
            [os.path.join(ROOT, "toolchain/revisit_flights.sh"), part, "twin_60"],
            env=environment,
            check=True,
            stdout=subprocess.DEVNULL,
        )

    return os.path.join(made("flights", make), "twin_60")


def twin():
    return replayed("twin", twin_flight(), "--loop-closure")


def twin_without_loops():
    return replayed("twin_without", twin_flight())


def kept_map():
    """The map of vil_v102 with true poses, in one file."""

    def make(part):
        swiftlet("fuse", log_folder("vil_v102"), "--out", part, "--keep", os.path.join(WORK, "v102.swm"))

    made("fused", make)
    return os.path.join(WORK, "v102.swm")


def calibrated():
    """A rendered calibration session of 30 s, its cameras calibrated: folder with report.html."""
    board = os.path.join(WORK, "board.yaml")
    if not os.path.exists(board):
        swiftlet("calibrate", "target", "--out", os.path.join(WORK, "board.pdf"), "--paper", "A3")
    session = made("session", lambda out: swiftlet("simulate", "--board", board, "--duration", "30", "--out", out))
    return made("lens", lambda out: swiftlet("calibrate", "cameras", session, "--target", board, "--out", out))


def draws():
    """ATE [m] of the odometry from 3 s on, {(log, cameras): one for each number of features}."""
    errors = {}
    for log in DRAWN_LOGS:
        for cameras, options in ((2, []), (1, ["--mono"])):
            for features in DRAWS:
                name = f"draws/{log}_{features}" + "".join(options)
                os.makedirs(os.path.join(WORK, "draws"), exist_ok=True)
                run = replayed(name, log_folder(log), *options, "--set", f"frontend.max_features={features}")
                figures = summary(run)["accuracy"]["odometry"]["from_3s"]["se3"]
                errors.setdefault((log, cameras), []).append(figures["ate_m"]["rmse"])
    return errors


# ---- what a run folder holds -------------------------------------------------------------------------------------


def summary(run):
    with open(os.path.join(run, "summary.json")) as file:
        return json.load(file)


class Trajectory:
    """Stamps [ns], positions [m] and rotations body to world."""

    def __init__(self, stamps, positions, rotations):
        self.stamps = np.asarray(stamps, dtype=np.int64)
        self.p = np.asarray(positions, dtype=float)
        self.R = np.asarray(rotations, dtype=float)

    def pick(self, indices):
        return Trajectory(self.stamps[indices], self.p[indices], self.R[indices])

    def moved(self, R, t):
        return Trajectory(self.stamps, self.p @ R.T + t, R @ self.R)


def rotation(w, x, y, z):
    q = np.stack([w, x, y, z], axis=-1).astype(float)
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    w, x, y, z = np.moveaxis(q, -1, 0)
    rows = [
        1 - 2 * (y * y + z * z),
        2 * (x * y - w * z),
        2 * (x * z + w * y),
        2 * (x * y + w * z),
        1 - 2 * (x * x + z * z),
        2 * (y * z - w * x),
        2 * (x * z - w * y),
        2 * (y * z + w * x),
        1 - 2 * (x * x + y * y),
    ]
    return np.stack(rows, axis=-1).reshape(q.shape[:-1] + (3, 3))


def rotation_vector(R):
    """Of small rotations, to well below a degree."""
    return 0.5 * np.stack(
        [R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], axis=-1
    )


def tum(run, name="odometry.tum"):
    stamps, values = [], []
    with open(os.path.join(run, name)) as file:
        for line in file:
            if line.startswith("#"):
                continue
            stamp, *rest = line.split()
            seconds, _, fraction = stamp.partition(".")
            stamps.append(int(seconds) * 10**9 + int(fraction.ljust(9, "0")[:9]))
            values.append([float(v) for v in rest])
    v = np.array(values)
    return Trajectory(stamps, v[:, :3], rotation(v[:, 6], v[:, 3], v[:, 4], v[:, 5]))


def truth(log):
    path = os.path.join(log, "mav0/state_groundtruth_estimate0/data.csv")
    with open(path) as file:
        rows = [line.split(",") for line in file if line[0].isdigit()]
    v = np.array([[float(x) for x in row[1:8]] for row in rows])
    return Trajectory([int(row[0]) for row in rows], v[:, :3], rotation(v[:, 3], v[:, 4], v[:, 5], v[:, 6]))


def states(run):
    """states.csv as {column without unit: array} in order of time; stamps as whole numbers."""
    with open(os.path.join(run, "states.csv")) as file:
        rows = list(csv.reader(file))
    # The file has the order in which keyframes left the window.
    rows[1:] = sorted(rows[1:], key=lambda row: int(row[0]))
    columns = {}
    for index, name in enumerate(rows[0]):
        key = name.lstrip("#").split(" ")[0]
        values = [row[index] for row in rows[1:]]
        if key == "timestamp":
            columns[key] = np.array([int(v) for v in values], dtype=np.int64)
        elif key != "health":
            columns[key] = np.array([float(v) for v in values])
    return columns


def loops(run):
    """loops.csv: (stamp of the old, of the new keyframe, verdict)."""
    with open(os.path.join(run, "loops.csv")) as file:
        return [(int(row[0]), int(row[1]), row[2]) for row in csv.reader(file) if row[0].isdigit()]


def at_stamps(trajectory, stamps):
    """The poses at given stamps: positions interpolated, rotations of the nearest; and which stamps have one."""
    stamps = np.asarray(stamps, dtype=np.int64)
    t = trajectory.stamps
    inside = (stamps >= t[0]) & (stamps <= t[-1])
    s = stamps[inside]
    # Relative to the first stamp a double holds nanoseconds.
    p = np.stack(
        [np.interp((s - t[0]).astype(float), (t - t[0]).astype(float), trajectory.p[:, k]) for k in range(3)], axis=1
    )
    after = np.clip(np.searchsorted(t, s), 1, len(t) - 1)
    nearest = np.where(s - t[after - 1] < t[after] - s, after - 1, after)
    return Trajectory(s, p, trajectory.R[nearest]), inside


def fitted(estimate, true):
    """The estimate moved onto the truth by the best rotation and translation (Umeyama 1991, no scale), and the truth at
    its stamps."""
    true, inside = at_stamps(true, estimate.stamps)
    estimate = estimate.pick(inside)
    a, b = estimate.p.mean(axis=0), true.p.mean(axis=0)
    U, _, Vt = np.linalg.svd((true.p - b).T @ (estimate.p - a))
    R = U @ np.diag([1, 1, np.sign(np.linalg.det(U @ Vt))]) @ Vt
    return estimate.moved(R, b - R @ a), true


def ate(estimate, true):
    return float(np.sqrt(((estimate.p - true.p) ** 2).sum(axis=1).mean()))


def keyframes(run):
    """keyframes.swk (docs/formats.md): [(stamp, [(track, pixel in camera 0 or None, in camera 1 or None)])]."""
    with open(os.path.join(run, "keyframes.swk"), "rb") as file:
        data = file.read()
    at = 16 + struct.unpack_from("<I", data, 12)[0]
    found = []
    while at + 12 <= len(data):
        _, kind, _, size = struct.unpack_from("<IHHI", data, at)
        at += 12
        if kind == 2:
            stamp, _, count = struct.unpack_from("<qII", data, at)
            # Pose (7), velocity, two biases (9) and three figures of the noise, f64.
            first = at + 16 + 8 * (7 + 9 + 3)
            features = []
            for i in range(count):
                track, in0, in1, _, u0, v0, u1, v1 = struct.unpack_from("<QBBHffff", data, first + 28 * i)
                features.append((track, (u0, v0) if in0 else None, (u1, v1) if in1 else None))
            if first + 28 * count != at + size:
                raise SystemExit("figures: keyframes.swk has another layout than docs/formats.md says")
            found.append((stamp, features))
        at += size
    return found


def image(log, stamp, camera=0):
    from PIL import Image

    folder = os.path.join(log, f"mav0/cam{camera}/data")
    for ending in ("jpg", "png", "jpeg"):
        path = os.path.join(folder, f"{stamp}.{ending}")
        if os.path.exists(path):
            return Image.open(path).convert("L")
    raise SystemExit(f"figures: {folder} has no image {stamp}")


class Camera:
    """A log's pinhole camera with radial-tangential distortion."""

    def __init__(self, log, camera=0):
        import yaml

        with open(os.path.join(log, f"mav0/cam{camera}/sensor.yaml")) as file:
            text = file.read().replace("%YAML:1.0", "")
        values = yaml.safe_load(text)
        self.T_body_cam = np.array(values["T_BS"]["data"], dtype=float).reshape(4, 4)
        self.fx, self.fy, self.cx, self.cy = values["intrinsics"]
        self.k1, self.k2, self.p1, self.p2 = values["distortion_coefficients"]
        self.width, self.height = values["resolution"]

    def distorted(self, x, y):
        r2 = x * x + y * y
        radial = 1 + self.k1 * r2 + self.k2 * r2 * r2
        return (
            x * radial + 2 * self.p1 * x * y + self.p2 * (r2 + 2 * x * x),
            y * radial + 2 * self.p2 * x * y + self.p1 * (r2 + 2 * y * y),
        )

    def project(self, points):
        """Points in the camera's axes to pixels; the lens's polynomial holds near the image only."""
        x, y = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2]
        x, y = self.distorted(x, y)
        return np.stack([self.fx * x + self.cx, self.fy * y + self.cy], axis=1)

    def rays(self, pixels):
        """Directions with z = 1."""
        x0 = (pixels[:, 0] - self.cx) / self.fx
        y0 = (pixels[:, 1] - self.cy) / self.fy
        x, y = x0.copy(), y0.copy()
        for _ in range(20):
            xd, yd = self.distorted(x, y)
            x, y = x + x0 - xd, y + y0 - yd
        return np.stack([x, y, np.ones_like(x)], axis=1)


def ply(path):
    """Vertices (structured), triangles and their labels of a PLY file that swiftlet wrote."""
    with open(path, "rb") as file:
        vertex_types, face_types, section, counts = [], [], None, {}
        sizes = {"float": "<f4", "uchar": "u1", "int": "<i4", "double": "<f8"}
        for line in iter(file.readline, b"end_header\n"):
            words = line.decode().split()
            if words[0] == "element":
                section = words[1]
                counts[section] = int(words[2])
            elif words[0] == "property" and section == "vertex":
                vertex_types.append((words[2], sizes[words[1]]))
            elif words[0] == "property" and words[1] == "list":
                face_types += [("corners", "u1"), ("vertices", "<i4", 3)]
            elif words[0] == "property":
                face_types.append((words[2], sizes[words[1]]))
        vertices = np.frombuffer(file.read(np.dtype(vertex_types).itemsize * counts["vertex"]), np.dtype(vertex_types))
        faces = np.frombuffer(file.read(np.dtype(face_types).itemsize * counts["face"]), np.dtype(face_types))
    points = np.stack([vertices["x"], vertices["y"], vertices["z"]], axis=1).astype(float)
    return points, vertices, faces["vertices"], faces["label"] if "label" in faces.dtype.names else None
