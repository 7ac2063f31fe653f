"""How all figures look: size, colours that colour-blind readers tell apart, and the same bytes from the same input."""

import io
import os
import re

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

# Okabe and Ito's palette (2008).
BLACK, ORANGE, SKY, GREEN, YELLOW, BLUE, RED, PINK = (
    "#000000",
    "#e69f00",
    "#56b4e9",
    "#009e73",
    "#f0e442",
    "#0072b2",
    "#d55e00",
    "#cc79a7",
)
GREY, LIGHT = "#666666", "#d9d9d9"

WIDTH_INCHES = 8.0  # at 100 dpi the 800 px of a page
MOST_BYTES = 150_000  # of one figure; all of them stay below 3 MB

plt.rcParams.update(
    {
        "svg.hashsalt": "swiftlet",
        "svg.fonttype": "none",
        "font.family": "sans-serif",
        "font.sans-serif": ["DejaVu Sans"],
        "font.size": 10,
        "axes.titlesize": 10.5,
        "axes.grid": True,
        "grid.color": LIGHT,
        "grid.linewidth": 0.6,
        "axes.axisbelow": True,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "legend.frameon": False,
        "lines.linewidth": 1.5,
        "figure.facecolor": "white",
        "path.simplify": True,
        "path.simplify_threshold": 0.3,
    }
)


def panels(rows, columns, height, **options):
    """A figure of the page's width and its axes."""
    return plt.subplots(rows, columns, figsize=(WIDTH_INCHES, height), layout="constrained", **options)


def save_svg(figure, path):
    """Coordinates are kept to a tenth of a point, which halves the file."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    plt.close(figure)
    text = re.sub(r"(-?\d+\.\d)\d+(?= -?\d| \n|\n| z)", r"\1", buffer.getvalue())
    with open(path, "w") as file:
        file.write(text)


def picture_of(figure, dpi=100):
    """The figure as an image, to be saved as JPEG."""
    from PIL import Image

    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi, metadata={"Software": None})
    plt.close(figure)
    return Image.open(buffer).convert("RGB")


def save_jpeg(image, path):
    """JPEG at the highest quality that keeps the figure small."""
    for quality in (88, 80, 72, 64, 56):
        image.save(path, quality=quality, optimize=True, progressive=True)
        if os.path.getsize(path) <= MOST_BYTES:
            return
