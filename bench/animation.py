"""Makes docs/screwing.webp, the moving picture of the README: a simulated hand screws a cap on.

    cargo build --release && python3 bench/animation.py target/release/slipbound docs/screwing.webp

Left the cap from above and what the left finger's camera saw, with measured (yellow) and rigid (light blue) displacement; right the
grip force over time, as commanded and as measured, and the load that the cap puts on. The frame turns purple while the hand sees slip.
All of it is read from a run of `slipbound demo --record`; the overlay is that of `slipbound watch` on the recorded frames.
Needs Pillow.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

WIDTH_PX, HEIGHT_PX = 800, 330
EVERY_FRAMES = 3
MS_A_FRAME = 100
LAST_MS = 1500
PAPER, INK, SOFT, GRID = "#ffffff", "#1c2127", "#56606b", "#e6e9ed"
BLUE, ORANGE, GREEN, SLIP = "#0072b2", "#c75200", "#00835f", "#961ec8"
CAMERA_PX = (16, 46, 360, 270)
"""Left, top, width and height of the camera's picture."""
ABOVE_PX, BELOW_PX = 108, 42
"""Of an overlay picture, what stands above and below the camera's."""
CHART_PX = (440, 60, 340, 200)


def font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size)


def chart(draw: ImageDraw.ImageDraw, cycles: list[dict], now: int) -> None:
    """Grip force up to now."""
    left, top, width, height = CHART_PX
    last_s = cycles[-1]["time_ns"] / 1e9

    def at(time_s: float, force_n: float) -> tuple[float, float]:
        return left + width * time_s / last_s, top + height * (1.0 - force_n / 66.0)

    for force_n in range(0, 61, 20):
        x, y = at(0.0, force_n)
        draw.line([(x, y), (left + width, y)], fill=GRID)
        draw.text((x - 6, y), str(force_n), fill=SOFT, font=font(13), anchor="rm")
    for time_s in range(0, int(last_s) + 1, 2):
        draw.text((at(time_s, 0.0)[0], top + height + 6), f"{time_s} s", fill=SOFT, font=font(13), anchor="mt")
    seen = cycles[: now + 1]
    slips = 0
    for cycle in seen:
        if cycle["slips_count"] > slips:
            slips = cycle["slips_count"]
            x, _ = at(cycle["time_ns"] / 1e9, 0.0)
            draw.line([(x, top), (x, top + height)], fill=SLIP, width=1)
            draw.ellipse([x - 8, top - 18, x + 8, top - 2], fill=SLIP)
            draw.text((x, top - 10), str(slips), fill=PAPER, font=font(12), anchor="mm")
    load = [at(c["time_ns"] / 1e9, c["truth"]["required_n"] or 0.0) for c in seen if c["truth"]]
    if len(load) > 1:
        floor = at(0.0, 0.0)[1]
        draw.polygon([(load[0][0], floor), *load, (load[-1][0], floor)], fill="#c9e6da")
        draw.line(load, fill=GREEN, width=1)
    commanded = [at(c["time_ns"] / 1e9, c["grip_command"].get("force_n") or 0.0) for c in seen]
    measured = [at(c["time_ns"] / 1e9, c["gripper"]["force_n"] or 0.0) for c in seen]
    for points, colour, wide in [(commanded, ORANGE, 2), (measured, BLUE, 3)]:
        if len(points) > 1:
            draw.line(points, fill=colour, width=wide)
    x = left
    for name, colour in [("commanded", ORANGE), ("measured", BLUE), ("least that holds", GREEN)]:
        draw.line([(x, 300), (x + 18, 300)], fill=colour, width=3)
        draw.text((x + 24, 300), name, fill=SOFT, font=font(13), anchor="lm")
        x += 46 + draw.textlength(name, font=font(13))


def cap(draw: ImageDraw.ImageDraw, angle_rad: float) -> None:
    """The cap from above between two fingers, in a corner of the camera's picture."""
    x, y, radius = 72, 268, 30
    draw.rounded_rectangle([x - 50, y - 38, x + 50, y + 38], 8, fill="#ffffff", outline=GRID)
    for side in (-1, 1):
        inner, outer = x + side * (radius + 1), x + side * 46
        draw.rounded_rectangle([min(inner, outer), y - 14, max(inner, outer), y + 14], 3, fill="#9db7d5")
    draw.ellipse([x - radius, y - radius, x + radius, y + radius], fill="#f2ce86", outline="#8a6a1c")
    for ridge in range(24):
        turn = angle_rad + ridge * math.tau / 24
        far, near = radius, radius - 5
        draw.line(
            [(x + near * math.cos(turn), y + near * math.sin(turn)), (x + far * math.cos(turn), y + far * math.sin(turn))],
            fill="#8a6a1c",
        )
    end = (x + 22 * math.cos(angle_rad), y + 22 * math.sin(angle_rad))
    draw.line([(x, y), end], fill=INK, width=3)


def picture(overlay: Path, cycles: list[dict], now: int) -> Image.Image:
    """One frame of the animation."""
    cycle = cycles[now]
    # A slip that was seen since the last picture shows, however short it was.
    lately = cycles[max(0, now - EVERY_FRAMES) : now + 1]
    slips = any(c["hand"]["state"] in ("incipient", "gross") for c in lately)
    page = Image.new("RGB", (WIDTH_PX, HEIGHT_PX), PAPER)
    whole = Image.open(overlay).convert("RGB")
    left, top, width, height = CAMERA_PX
    half = (whole.width - 4) // 2
    seen = whole.crop((0, ABOVE_PX, half, whole.height - BELOW_PX)).resize((width, height), Image.Resampling.LANCZOS)
    page.paste(seen, (left, top))
    draw = ImageDraw.Draw(page)
    angle_rad = (cycle["truth"] or {}).get("cap_angle_rad") or 0.0
    cap(draw, angle_rad)
    if slips:
        draw.rectangle([left - 3, top - 3, left + width + 2, top + height + 2], outline=SLIP, width=6)
        draw.rounded_rectangle([left + width - 128, top + 8, left + width - 8, top + 36], 6, fill=SLIP)
        draw.text((left + width - 68, top + 22), "incipient slip", fill=PAPER, font=font(16), anchor="mm")
    draw.text((left, 24), "a cap is screwed on: left finger", fill=INK, font=font(18), anchor="lm")
    draw.text((CHART_PX[0] - 30, 24), "grip force, N per finger", fill=INK, font=font(18), anchor="lm")
    told = f"{cycle['time_ns'] / 1e9:.2f} s"
    draw.text((WIDTH_PX - 16, 24), told, fill=SOFT, font=font(16), anchor="rm")
    chart(draw, cycles, now)
    if cycle["phase"]["phase"] == "ended":
        draw.rounded_rectangle([470, 82, 570, 116], 6, fill=GREEN)
        draw.text((520, 99), "tight", fill=PAPER, font=font(20), anchor="mm")
    return page


def main() -> None:
    program, out = sys.argv[1:]
    with tempfile.TemporaryDirectory() as folder:
        run, pictures = f"{folder}/run", f"{folder}/pictures"
        subprocess.run([program, "demo", "--record", "-o", run], check=True, stdout=subprocess.DEVNULL)
        watch = [program, "watch", f"{run}/left", "--sensor", f"{run}/left.sensor.toml", "--overlay", pictures]
        subprocess.run(watch, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        cycles = [json.loads(line) for line in Path(f"{run}/reports.jsonl").read_text().splitlines()]
        overlays = sorted(Path(pictures).glob("*.png"))
        # A cycle is of the frame with its time; frames come 30 times a second.
        frame_of = [min(round(cycle["time_ns"] * 30 / 1e9), len(overlays) - 1) for cycle in cycles]
        shown = [*range(0, len(cycles), EVERY_FRAMES), len(cycles) - 1]
        frames = [picture(overlays[frame_of[now]], cycles, now) for now in shown]
    times_ms = [MS_A_FRAME] * (len(frames) - 1) + [LAST_MS]
    frames[0].save(out, save_all=True, append_images=frames[1:], duration=times_ms, loop=0, quality=55, method=4)
    print(f"{out}: {len(frames)} frames, {Path(out).stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
