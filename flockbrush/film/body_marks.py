"""The colour and the length of the animals' bodies, picked by a person in a film."""

from __future__ import annotations

import cv2
import numpy as np

NEAR = 22.0  # distance in CIELAB up to which a pixel has the body's colour
AROUND = 2  # pixels about a click whose colour is taken


def colour_at(image, x, y) -> tuple[int, int, int]:
    """Red, green and blue about a place of a picture (h, w, 3, blue first): the median of a small square."""
    x, y = int(np.clip(x, 0, image.shape[1] - 1)), int(np.clip(y, 0, image.shape[0] - 1))
    part = image[max(0, y - AROUND) : y + AROUND + 1, max(0, x - AROUND) : x + AROUND + 1]
    blue, green, red = np.median(part.reshape(-1, 3), axis=0)
    return int(red), int(green), int(blue)


def body_mask(image, colour) -> np.ndarray:
    """Where a picture (h, w, 3, blue first) has the body's colour, (h, w) bool: near in CIELAB.

    Parameters
    ----------
    colour : (int, int, int)
        Red, green, blue.
    """
    lab = cv2.cvtColor(image, cv2.COLOR_BGR2LAB).astype(np.int16)
    body = cv2.cvtColor(np.array([[colour[::-1]]], np.uint8), cv2.COLOR_BGR2LAB)[0, 0].astype(np.int16)
    away = lab - body
    light = 100 / 255  # of OpenCV's bytes
    return (away[..., 0] * light) ** 2 + away[..., 1].astype(float) ** 2 + away[..., 2].astype(float) ** 2 <= NEAR**2
