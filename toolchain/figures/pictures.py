"""Pictures out of images, meshes and maps of runs. Only rendered logs are shown: their images are the project's own."""

import json
import os

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm, Normalize, to_rgb
from PIL import Image, ImageDraw

import runs
from style import BLUE, GREEN, GREY, LIGHT, ORANGE, PINK, RED, SKY, YELLOW, panels, picture_of, plt, save_jpeg

LOG = "vil_v102"
MOMENT_S = 9.0  # of the log: furniture near and far, the vehicle turning

# Labels of labels0/labels.csv in the order of their numbers.
LABELS = ("unlabelled", "floor", "ceiling", "wall", "pillar", "shelf", "table", "chair", "box", "poster", "machine")
LABEL_COLORS = (GREY, "#c9b99a", LIGHT, "#e8e4da", SKY, GREEN, ORANGE, PINK, RED, BLUE, YELLOW)


def keyframe_index(keyframes):
    start = keyframes[0][0]
    return min(range(len(keyframes)), key=lambda i: abs((keyframes[i][0] - start) * 1e-9 - MOMENT_S))


def shown_image(axis, picture):
    axis.imshow(np.asarray(picture), cmap="gray", vmin=0, vmax=255)
    axis.set(xlim=(-0.5, picture.width - 0.5), ylim=(picture.height - 0.5, -0.5), xticks=[], yticks=[])
    axis.grid(False)
    for spine in axis.spines.values():
        spine.set_visible(False)


def tracks(path):
    """The last keyframe's features with where they were in the keyframes before it."""
    keyframes = runs.keyframes(runs.v102())
    last = keyframe_index(keyframes)
    past = {}
    for _, features in keyframes[: last + 1]:
        for track, pixel, _ in features:
            if pixel:
                past.setdefault(track, []).append(pixel)
    shown, most = 4, 12  # keyframes of a path; of the colours
    stamp, features = keyframes[last]
    figure, axis = panels(1, 1, 5.2)
    shown_image(axis, runs.image(runs.log_folder(LOG), stamp))
    norm, colors = Normalize(1, most), plt.get_cmap("viridis")
    features = [feature for feature in features if feature[1]]
    for track, pixel, _ in features:
        line = np.array(past[track])
        color = colors(norm(min(len(line), most)))
        axis.plot(line[-shown:, 0], line[-shown:, 1], color=color, linewidth=1.2)
        axis.plot(*pixel, "o", color=color, markersize=3.6, markeredgecolor="white", markeredgewidth=0.4)
    bar = figure.colorbar(ScalarMappable(norm, colors), ax=axis, shrink=0.85, pad=0.01)
    bar.set_label("keyframes that have seen the feature (12: or more)")
    axis.set_title(
        f"{len(features)} features of one keyframe; lines: where the {shown - 1} keyframes before it saw them"
    )
    save_jpeg(picture_of(figure), path)


def distances(left, right, pixels0, pixels1):
    """Distances along the optical axis of camera 0 [m] of matched pixels: the point nearest to both rays."""
    T = np.linalg.inv(left.T_body_cam) @ right.T_body_cam
    a = left.rays(pixels0)
    b = right.rays(pixels1) @ T[:3, :3].T
    t = T[:3, 3]
    aa, bb, ab = (a * a).sum(1), (b * b).sum(1), (a * b).sum(1)
    at, bt = a @ t, b @ t
    return (at * bb - bt * ab) / (aa * bb - ab * ab)


def stereo_matches(path):
    log = runs.log_folder(LOG)
    keyframes = runs.keyframes(runs.v102())
    stamp, features = keyframes[keyframe_index(keyframes)]
    matched = [(a, b) for _, a, b in features if a and b]
    a, b = np.array([m[0] for m in matched]), np.array([m[1] for m in matched])
    z = distances(runs.Camera(log, 0), runs.Camera(log, 1), a, b)
    norm, colors = LogNorm(1, 8), plt.get_cmap("viridis_r")
    figure, axes = panels(1, 2, 3.0)
    for camera, (axis, pixels) in enumerate(zip(axes, (a, b))):
        shown_image(axis, runs.image(log, stamp, camera))
        axis.scatter(
            pixels[:, 0],
            pixels[:, 1],
            c=np.clip(z, 1, 8),
            cmap=colors,
            norm=norm,
            s=13,
            edgecolors="white",
            linewidths=0.4,
        )
        axis.set_title(f"camera {camera}")
    # Where the same point lies in the other image: the shift is what tells its distance.
    for (u, v), (u0, v0), distance in zip(b, a, z):
        axes[1].plot([u0, u], [v0, v], color=colors(norm(np.clip(distance, 1, 8))), linewidth=0.8)
    bar = figure.colorbar(ScalarMappable(norm, colors), ax=axes, shrink=0.8, pad=0.01, ticks=[1, 2, 4, 8])
    bar.ax.set_yticklabels(["1", "2", "4", "8"])
    bar.minorticks_off()
    bar.set_label("distance [m]")
    figure.suptitle(f"{len(matched)} features matched in both images; lines: from the pixel in camera 0")
    save_jpeg(picture_of(figure), path)


def mesh_over_image(path):
    log, run = runs.log_folder(LOG), runs.v102()
    camera = runs.Camera(log, 0)
    keyframes = runs.keyframes(run)
    stamp = keyframes[keyframe_index(keyframes)][0]
    with open(os.path.join(run, "meshes/frames.csv")) as file:
        mesh = next(row.split(",")[3] for row in file if row.split(",")[1] == str(stamp))
    points, _, faces, _ = runs.ply(os.path.join(run, "meshes", mesh))
    poses = runs.tum(run)
    at = int(np.argmin(np.abs(poses.stamps - stamp)))
    in_body = (points - poses.p[at]) @ poses.R[at]
    T = np.linalg.inv(camera.T_body_cam)
    in_camera = in_body @ T[:3, :3].T + T[:3, 3]
    pixels = camera.project(in_camera)
    z = in_camera[:, 2]
    norm, colors = LogNorm(1, 8), plt.get_cmap("viridis_r")
    figure, axis = panels(1, 1, 5.2)
    shown_image(axis, runs.image(log, stamp))
    far_first = np.argsort(-z[faces].mean(axis=1))
    for face in faces[far_first]:
        if (z[face] < 0.2).any():
            continue
        corners = pixels[face]
        color = colors(norm(np.clip(z[face].mean(), 1, 8)))
        axis.fill(
            corners[:, 0], corners[:, 1], facecolor=(*color[:3], 0.22), edgecolor=(*color[:3], 0.95), linewidth=0.8
        )
    bar = figure.colorbar(ScalarMappable(norm, colors), ax=axis, shrink=0.85, pad=0.01, ticks=[1, 2, 4, 8])
    bar.ax.set_yticklabels(["1", "2", "4", "8"])
    bar.minorticks_off()
    bar.set_label("distance [m]")
    axis.set_title(f"the mesh of one frame, {len(faces)} triangles, over the image of camera 0")
    save_jpeg(picture_of(figure), path)


# ---- the map -----------------------------------------------------------------------------------------------------

PICTURE = (1600, 960)  # drawn at twice the size


class View:
    """Perspective from an eye to a target, z up; pixels of PICTURE."""

    def __init__(self, eye, target):
        forward = np.asarray(target, float) - eye
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, [0, 0, 1.0])
        right /= np.linalg.norm(right)
        self.eye = np.asarray(eye, float)
        self.R = np.stack([right, np.cross(forward, right), forward])
        self.focal, self.centre = 1.0, np.zeros(2)

    def fit(self, points):
        """Scale and centre so that these points fill the picture."""
        pixels, _ = self.project(points)
        low, high = pixels.min(axis=0), pixels.max(axis=0)
        self.focal = (0.98 * np.array(PICTURE) / (high - low)).min()
        self.centre = np.array(PICTURE) / 2 - self.focal * (low + high) / 2

    def project(self, points):
        """Pixels and distances along the view."""
        p = (points - self.eye) @ self.R.T
        return p[:, :2] * self.focal / np.maximum(p[:, 2:], 1e-6) + self.centre, p[:, 2]


def labelled_map(path):
    """The surface of the whole flight without its ceiling, seen through the walls that turn away, and the trajectory."""
    run = runs.v102()
    points, _, faces, labels = runs.ply(os.path.join(run, "map.ply"))
    flown = runs.tum(run, "map.tum").p
    keep = (labels != LABELS.index("ceiling")) & (points[faces][:, :, 2].max(axis=1) < flown[:, 2].max() + 0.35)
    faces, labels = faces[keep], labels[keep]
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    low, high = np.percentile(points, 1, axis=0), np.percentile(points, 99, axis=0)
    target = 0.5 * (low + high) + [0, 0, -0.4]
    view = View(target + np.array([-6.0, -9.0, 10.5]), target)
    view.fit(points[np.unique(faces)])
    pixels, depth = view.project(points)
    toward = ((view.eye - corners.mean(axis=1)) * normals).sum(axis=1) > 0
    faces, labels, normals = faces[toward], labels[toward], normals[toward]
    light = np.array([-0.5, -0.6, 0.62])
    shade = 0.72 + 0.28 * np.clip(normals @ light, 0, 1)
    colors = np.array([to_rgb(c) for c in LABEL_COLORS])[np.minimum(labels, len(LABELS) - 1)] * shade[:, None]
    colors = (255 * colors).astype(int)
    image = Image.new("RGB", PICTURE, "white")
    draw = ImageDraw.Draw(image)
    for i in np.argsort(-depth[faces].mean(axis=1), kind="stable"):
        draw.polygon([tuple(pixels[v]) for v in faces[i]], fill=tuple(colors[i]))
    line, _ = view.project(flown)
    draw.line([tuple(p) for p in line], fill="white", width=9, joint="curve")
    draw.line([tuple(p) for p in line], fill="black", width=4, joint="curve")
    image = image.resize((PICTURE[0] // 2, PICTURE[1] // 2), Image.LANCZOS)
    figure, axis = panels(1, 1, 5.4)
    axis.imshow(np.asarray(image))
    axis.axis("off")
    used = [k for k in range(1, len(LABELS)) if (labels == k).any()]
    handles = [plt.Rectangle((0, 0), 1, 1, color=LABEL_COLORS[k]) for k in used]
    handles.append(plt.Line2D([], [], color="black", linewidth=2))
    axis.legend(
        handles,
        [LABELS[k] for k in used] + ["trajectory"],
        loc="upper center",
        bbox_to_anchor=(0.5, 0),
        ncols=5,
        fontsize=9,
    )
    save_jpeg(picture_of(figure), path)


def distance_slice(path):
    """The distance field of the map at one height: known distances by colour, the rest by kind."""
    height = 1.6  # of the log's truth: 1 m above the floor
    kept = runs.kept_map()
    picture, figures_file = os.path.join(runs.WORK, "slice.png"), os.path.join(runs.WORK, "slice.json")
    runs.swiftlet("map", "slice", kept, "--out", picture, "--z", str(height), "--json", figures_file)
    with open(figures_file) as file:
        extent = json.load(file)["extent_m"]
    metres = np.asarray(Image.open(picture.replace(".png", "_mm.png"))) * 1e-3
    kinds = np.asarray(Image.open(picture).convert("RGB"))
    # The program's colours of what has no distance (docs/distance.md).
    shown = np.full(kinds.shape, 255, np.uint8)
    for theirs, ours in (((150, 150, 150), LIGHT), ((75, 35, 95), PINK), ((0, 0, 0), "black"), ((130, 175, 235), SKY)):
        shown[(kinds == theirs).all(axis=2)] = 255 * np.array(to_rgb(ours))
    frame = [*extent["x"], *extent["y"]]
    figure, axis = plt.subplots(figsize=(6.2, 6), layout="constrained")
    axis.imshow(shown, extent=frame, interpolation="nearest")
    field = axis.imshow(
        np.where(metres > 0, metres, np.nan), extent=frame, interpolation="nearest", cmap="viridis", vmin=0
    )
    # The program takes the surface's voxels for distance 0 or a few millimetres: black, as the walls they are.
    surface = (kinds == (0, 0, 0)).all(axis=2)
    axis.imshow(np.where(surface[..., None], [0, 0, 0, 1.0], [0, 0, 0, 0]), extent=frame, interpolation="nearest")
    flown = runs.truth(runs.log_folder(LOG)).p
    axis.plot(flown[:, 0], flown[:, 1], color="white", linewidth=1.4)
    axis.set(xlabel="x [m]", ylabel="y [m]", title="distance to the nearest surface, 1 m above the floor")
    axis.grid(False)
    bar = figure.colorbar(field, ax=axis, shrink=0.85, pad=0.02)
    bar.set_label("distance [m]")
    handles = [plt.Rectangle((0, 0), 1, 1, color=c) for c in ("black", PINK, LIGHT)]
    handles.append(plt.Line2D([], [], color=GREY, linewidth=1.4))
    axis.legend(
        handles,
        ["surface", "behind a surface", "unknown", "trajectory (white)"],
        loc="upper center",
        bbox_to_anchor=(0.5, -0.1),
        ncols=4,
        fontsize=9,
    )
    save_jpeg(picture_of(figure), path)
