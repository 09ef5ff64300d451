"""The peers' side of `augment.py`: runs in an environment of its own and prints JSON.

It is not to be run by hand.

Every work takes the same screenshot and returns a new picture (in-place libraries are given a copy
inside the timing, as the others make one themselves). A work is `marks` (50 shapes of 40 pixels),
`subtitle` (two outlined lines of 48-pixel text), `pop_up` (a 960x540 window with three lines of
text and a button) or `resolution` (half size, bicubic).

    python peers.py PICTURE.npy FONT.ttf THREADS
"""

import importlib.metadata
import json
import math
import random
import sys
import time
import warnings

import numpy as np

warnings.filterwarnings("ignore")
LINES = ("QQ MUSIC, LISTEN TO WHAT YOU WANT", "------CHOOSE a SONG to PLAY------")
FONT = sys.argv[2]
THREADS = int(sys.argv[3])
draw = random.Random(0)


def centres(count=50):
    return [(draw.randint(20, 1899), draw.randint(20, 1059)) for _ in range(count)]


def window_lines(x, y):
    return "Install New Extenstion", f"Please click: ({x}, {y})", "to Continue"


def star(x, y, r=20):
    radii = (r if i % 2 == 0 else 0.4 * r for i in range(10))
    return [
        (x + q * math.sin(math.pi * i / 5), y - q * math.cos(math.pi * i / 5))
        for i, q in enumerate(radii)
    ]


def pillow(image):
    from PIL import Image, ImageDraw, ImageFont

    picture = Image.fromarray(image)
    font = ImageFont.truetype(FONT, 48)
    large = ImageFont.truetype(FONT, 44)
    small = ImageFont.truetype(FONT, 38)

    def marks():
        out = picture.copy()
        pen = ImageDraw.Draw(out)
        for x, y in centres():
            pen.polygon(star(x, y), fill=(255, 0, 0))
        return out

    def subtitle():
        out = picture.copy()
        ImageDraw.Draw(out).text(
            (400, 900), "\n".join(LINES), "white", font, stroke_width=2, stroke_fill="black"
        )
        return out

    def pop_up():
        out = picture.copy()
        pen = ImageDraw.Draw(out)
        x = draw.randint(0, 960)
        y = draw.randint(0, 540)
        pen.rectangle((x, y, x + 959, y + 489), "white", "black", 2)
        pen.rectangle((x, y + 490, x + 959, y + 539), "#e6e6e6", "black", 2)
        for i, line in enumerate(window_lines(x, y)):
            pen.text((x + 480, y + 194 + 51 * i), line, "black", large, anchor="mm")
        pen.text((x + 480, y + 515), "OK", "black", small, anchor="mm")
        return out

    half = (image.shape[1] // 2, image.shape[0] // 2)
    return {
        "marks": marks,
        "subtitle": subtitle,
        "pop_up": pop_up,
        "resolution": lambda: picture.resize(half, Image.Resampling.BICUBIC),
    }


def opencv(image):
    import cv2

    cv2.setNumThreads(THREADS)

    def marks():
        out = image.copy()
        for x, y in centres():
            cv2.fillPoly(out, [np.array(star(x, y), np.int32)], (255, 0, 0))
        return out

    def text(out, x, y, words, scale, color, thick=2):
        cv2.putText(out, words, (x, y), cv2.FONT_HERSHEY_SIMPLEX, scale, color, thick, cv2.LINE_AA)

    def subtitle():
        out = image.copy()
        for i, line in enumerate(LINES):
            text(out, 400, 940 + 60 * i, line, 1.6, (0, 0, 0), 6)
            text(out, 400, 940 + 60 * i, line, 1.6, (255, 255, 255))
        return out

    def pop_up():
        out = image.copy()
        x = draw.randint(0, 960)
        y = draw.randint(0, 540)
        for top, bottom, fill in ((0, 489, (255, 255, 255)), (490, 539, (230, 230, 230))):
            cv2.rectangle(out, (x, y + top), (x + 959, y + bottom), fill, -1)
            cv2.rectangle(out, (x, y + top), (x + 959, y + bottom), (0, 0, 0), 2)
        for i, line in enumerate(window_lines(x, y)):
            text(out, x + 250, y + 194 + 51 * i, line, 1.4, (0, 0, 0))
        text(out, x + 450, y + 530, "OK", 1.2, (0, 0, 0))
        return out

    half = (image.shape[1] // 2, image.shape[0] // 2)
    resize = lambda: cv2.resize(image, half, interpolation=cv2.INTER_CUBIC)  # noqa: E731
    return {"marks": marks, "subtitle": subtitle, "pop_up": pop_up, "resolution": resize}


def albumentations(image):
    import albumentations as A
    import cv2

    cv2.setNumThreads(THREADS)
    holes = {
        "hole_height_range": (40, 40),
        "hole_width_range": (40, 40),
        "fill": (255, 0, 0),
        "p": 1,
    }
    marks = A.CoarseDropout(num_holes_range=(50, 50), **holes)
    window = A.CoarseDropout(
        (1, 1), hole_height_range=(540, 540), hole_width_range=(960, 960), fill=255, p=1
    )
    write = A.TextImage(
        font_path=FONT, font_size_fraction_range=(0.9, 0.9), augmentations=(None,), p=1
    )
    boxes = [
        {"bbox": (0.2, 0.8 + 0.05 * i, 0.8, 0.85 + 0.05 * i), "text": line}
        for i, line in enumerate(LINES)
    ]
    small = A.Resize(image.shape[0] // 2, image.shape[1] // 2, interpolation=cv2.INTER_CUBIC, p=1)
    return {
        "marks": lambda: marks(image=image)["image"],
        "subtitle": lambda: write(image=image, textimage_metadata=boxes)["image"],
        "pop_up (no text)": lambda: window(image=image)["image"],
        "resolution": lambda: small(image=image)["image"],
    }


def augly(image):
    import augly.image as imaugs
    from PIL import Image

    picture = Image.fromarray(image)
    codes = [[ord(c) for c in line] for line in LINES]
    half = {"width": image.shape[1] // 2, "height": image.shape[0] // 2}
    return {
        "subtitle": lambda: imaugs.overlay_text(
            picture, text=codes, font_size=0.05, x_pos=0.2, y_pos=0.8
        ),
        "resolution": lambda: imaugs.resize(picture, **half),
    }


def kornia(image):
    import kornia.augmentation as K
    import torch
    from kornia.geometry import resize

    torch.set_num_threads(THREADS)
    planar = torch.from_numpy(image).permute(2, 0, 1)[None].contiguous()
    share = 960 * 540 / (1080 * 1920)
    erase = K.RandomErasing(scale=(share, share), ratio=(0.5625, 0.5625), value=1.0, p=1)
    half = (image.shape[0] // 2, image.shape[1] // 2)

    def through_float(work):
        return (work(planar.float() / 255) * 255).round().clamp(0, 255).to(torch.uint8)

    return {
        "pop_up (no text)": lambda: through_float(erase),
        "resolution": lambda: through_float(lambda x: resize(x, half, "bicubic", antialias=True)),
    }


def imgaug(image):
    import imgaug.augmenters as iaa

    marks = iaa.Cutout(nb_iterations=50, size=0.03, fill_mode="constant", cval=255)
    small = iaa.Resize(0.5, interpolation="cubic")
    return {"marks": lambda: marks(image=image), "resolution": lambda: small(image=image)}


PEERS = {
    "Pillow": (pillow, "pillow"),
    "OpenCV": (opencv, "opencv-python-headless"),
    "Albumentations": (albumentations, "albumentations"),
    "AugLy": (augly, "augly"),
    "Kornia": (kornia, "kornia"),
    "imgaug": (imgaug, "imgaug"),
}


def times(work, runs=15):
    work()
    out = []
    for _ in range(runs):
        start = time.perf_counter()
        work()
        out.append((time.perf_counter() - start) * 1e3)
    return out


def main():
    image = np.load(sys.argv[1])
    target = image.copy()
    entries = {}
    for name, (make, package) in PEERS.items():
        try:
            version = importlib.metadata.version(package)
            works = make(image)
        except Exception as error:  # noqa: BLE001  (a peer that does not import is a result)
            entries[name] = {
                "version": "",
                "error": f"{type(error).__name__}: {error}"[:120],
                "works": {},
            }
            continue
        rows = {}
        for work, run in works.items():
            try:
                rows[work] = {
                    "times": times(run),
                    "memcpy": times(lambda: np.copyto(target, image)),
                }
            except Exception as error:  # noqa: BLE001
                rows[work] = {"error": f"{type(error).__name__}: {error}"[:120]}
        entries[name] = {"version": version, "works": rows}
    print(json.dumps(entries))


if __name__ == "__main__":
    main()
