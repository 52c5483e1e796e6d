"""Draws the pictures that `lumbre export --figuregen` wrote beside this file, with figuregen.

    pip install figuregen && python figure.py

Each row is a facet; its columns are the reference and the series, with their errors below. Change EXPOSURE, METRIC and
CROP to your taste.
"""

import json
from pathlib import Path

import figuregen
import simpleimageio as sio

EXPOSURE = 0.0  # stops
METRIC = None  # name of a metric below each picture; None for the first
CROP = None  # (left, top, width, height) in pixels, drawn as a frame

here = Path(__file__).parent
rows = json.loads((here / "figure.json").read_text())["rows"]
columns = 1 + max(len(row["series"]) for row in rows)
grid = figuregen.Grid(len(rows), columns)


def picture(file):
    radiance = sio.read(str(here / file)) * 2.0**EXPOSURE
    return figuregen.PNG(sio.lin_to_srgb(radiance))


for i, row in enumerate(rows):
    entries = [{"title": "reference", "image": row["reference"], "errors": {}}, *row["series"]]
    for j, entry in enumerate(entries):
        if entry["image"] is None:
            continue
        element = grid.get_element(i, j)
        element.set_image(picture(entry["image"]))
        errors = entry["errors"]
        metric = METRIC or next(iter(errors), None)
        if metric in errors:
            element.set_caption(f"{metric} {errors[metric]:.3g}")
        if CROP is not None:
            element.set_marker(CROP[:2], CROP[2:], color=[255, 255, 255])
    if i == 0:
        grid.set_col_titles("top", [entry["title"] for entry in entries])
grid.set_row_titles("left", [row["title"] for row in rows])
figuregen.figure([[grid]], width_cm=17.7, filename=str(here / "figure.html"))
