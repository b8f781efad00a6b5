"""Draw the result of the demo."""

from pathlib import Path

from eitskin.demo.demo import TOUCHES, Demo
from eitskin.view.frame_pictures import found_marks
from eitskin.view.panels import draw_frame
from eitskin.view.pictures import Mark


def draw_demo(path: str | Path, demo: Demo) -> None:
    skin = demo.model.skin
    truth = [
        Mark(t.x_mm, t.y_mm, t.radius_mm, (t.contrast - 1) * skin.conductivity_s_per_m)
        for t in TOUCHES
    ]
    title = f"three simulated touches at {demo.frames.meta['snr_db']:g} dB, solved by the C core"
    found = found_marks(demo.result)
    draw_frame(
        path, skin, demo.model.grid, demo.result.image, truth=truth, found=found, title=title
    )
