"""All drawings of the rig, by the names of their files."""

from pathlib import Path

from firmware.drawings import part_views, side_view, top_view, wiring, yaw_views

DRAWINGS = {
    "top": top_view.drawing,
    "side": side_view.drawing,
    "yaw-dynamic": yaw_views.dynamic,
    "yaw-circle": yaw_views.circle,
    "holder": part_views.drawing,
    "wiring": wiring.drawing,
}


def write(folder: Path) -> list[Path]:
    """Writes each as SVG; the files."""
    files = [folder / f"{name}.svg" for name in DRAWINGS]
    for file, draw in zip(files, DRAWINGS.values(), strict=True):
        file.write_text(draw())
    return files
