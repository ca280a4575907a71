"""Pictures of flocks before a plain sky, and where their birds are."""

import cv2
import numpy as np

V = [(200 + 40 * k, 80 + 30 * abs(k)) for k in range(-4, 5)]  # pixels; they fly up


def sky(birds=V, shift=(0, 0), size=(400, 300)):
    """A picture (h, w, 3) with a bird at each place."""
    image = np.full((size[1], size[0], 3), 215, np.uint8)
    for x, y in birds:
        cv2.ellipse(image, (round(x + shift[0]), round(y + shift[1])), (11, 4), 0, 0, 360, (40, 40, 40), -1)
    return image


def film(folder, count=4, birds=V, step=(3, 2), without=None):
    """Pictures of a flock on its way; `without` leaves a bird out of frames: {frame: bird}."""
    paths = []
    for k in range(count):
        here = [bird for b, bird in enumerate(birds) if (without or {}).get(k) != b]
        paths.append(folder / f"frame{k}.png")
        cv2.imwrite(str(paths[-1]), sky(here, (k * step[0], k * step[1])))
    return paths
