"""Pictures that resemble photographs of flocks: necks and flapping wings, gradients, clouds, moon, branches."""

import cv2
import numpy as np

FINE = 4  # drawn so many times as large, then shrunk: edges are soft, as a lens makes them


def goose(beat, neck=0.5):
    """Outlines of a bird that flies to the right, seen from below and aside, one wingspan wide: [body, wing, wing].

    ``beat``: -1 wings down to 1 wings up.
    """
    t = np.linspace(0, 2 * np.pi, 24)
    body = np.c_[0.24 * np.cos(t), 0.07 * np.sin(t)]
    neck_ = np.array([(0.15, -0.04), (0.2 + neck * 0.5, -0.02), (0.2 + neck * 0.5, 0.03), (0.15, 0.05)])
    lift = 0.30 * beat
    near = np.array([(0.12, 0.0), (0.05, 0.25 + 0.5 * lift), (-0.1, 0.5), (-0.16, 0.48), (-0.14, 0.2), (-0.14, 0.0)])
    far = near * (1.0, -1.0)
    for wing in (near, far):
        wing[1:5, 1] += lift * np.abs(wing[1:5, 1])
    return [np.vstack([body]), neck_, near, far]


def clouds(shape, rng, depth=25.0):
    """A sky (h, w) that grows lighter downward, with soft clouds."""
    h, w = shape
    rows, _ = np.mgrid[:h, :w]
    sky = 150.0 + 50.0 * rows / h
    for cells in (3, 7, 15):
        coarse = rng.normal(size=(cells, cells)).astype(np.float32)
        sky += depth * 2.0 / cells * cv2.resize(coarse, (w, h), interpolation=cv2.INTER_CUBIC)
    return sky


def photograph(birds, span, seed=0, shape=(480, 640), heading=0.0, dark=45.0, body=None, beats=1.0):
    """A picture (h, w, 3) uint8 of birds at (x, y) pixels, ``span`` pixels from tip to tip.

    Parameters
    ----------
    heading : float
        Degrees counter-clockwise from the right.
    dark : float
        Grey level of the wings.
    body : float, optional
        Grey level of the bodies, of the sky where it is "sky"; as the wings unless told.
    beats : float
        How far wings go up and down.
    """
    rng = np.random.default_rng(seed)
    sky = clouds(shape, rng)
    fine = cv2.resize(sky, None, fx=FINE, fy=FINE, interpolation=cv2.INTER_LINEAR)
    c, s = np.cos(np.radians(heading)), np.sin(np.radians(heading))
    turn = np.array([(c, -s), (s, c)])  # pictures count downward
    for x, y in birds:
        parts = goose(beats * rng.uniform(-1, 1))
        grey = float(sky[int(np.clip(y, 0, shape[0] - 1)), int(np.clip(x, 0, shape[1] - 1))])
        tone = dark if body is None else grey if body == "sky" else body
        for part, level in [(parts[2], dark), (parts[3], dark), (parts[1], dark), (parts[0], tone)]:
            at = (np.array([x, y]) + span * rng.uniform(0.95, 1.05) * part @ turn) * FINE
            cv2.fillPoly(fine, [at.round().astype(np.int32)], level)
    image = cv2.resize(fine, shape[::-1], interpolation=cv2.INTER_AREA) + rng.normal(0, 2.0, shape)
    image = cv2.GaussianBlur(image, (0, 0), 0.6)
    return np.repeat(np.clip(image, 0, 255).astype(np.uint8)[..., None], 3, axis=2)


def moon(image, at, radius, level=245):
    """The picture with a bright disc."""
    return cv2.circle(image.copy(), at, radius, (level,) * 3, -1, cv2.LINE_AA)


def branches(image, seed=0, level=30):
    """The picture with twigs that come in from the lower left corner."""
    rng, out = np.random.default_rng(seed), image.copy()
    h = image.shape[0]
    for _ in range(6):
        at, angle, width = np.array([0.0, h - rng.uniform(0, 0.25) * h]), rng.uniform(-0.9, 0.1), 7.0
        for _ in range(9):
            to = at + 0.045 * h * np.array([np.cos(angle), np.sin(angle)])
            cv2.line(
                out, at.astype(int).tolist(), to.astype(int).tolist(), (level,) * 3, max(1, int(width)), cv2.LINE_AA
            )
            at, angle, width = to, angle + rng.normal(0, 0.35), 0.8 * width
    return out


def in_a_v(count, span, apex, heading=0.0, slope=0.8, spacing=1.25):
    """Places (n, 2), pixels, of a V whose leader is at ``apex``; +heading counter-clockwise from the right."""
    k = np.arange(count) - count // 2
    along, across = -slope * spacing * np.abs(k), spacing * k
    c, s = np.cos(np.radians(heading)), np.sin(np.radians(heading))
    return np.asarray(apex) + span * np.c_[along * c + across * s, -along * s + across * c]


def flapping_film(seed=0, span=16.0, frames=40, birds=6, shape=(270, 480), thin=False):
    """(places (F, N, 2) px, pictures (h, w) uint8) of birds that fly to the right and beat drawn wings.

    ``thin``: bodies with wings of two pixels, as strokes; else as `goose`.
    """
    rng = np.random.default_rng(seed)
    start = np.c_[rng.uniform(30, 200, birds), np.linspace(40, 230, birds) + rng.uniform(-10, 10, birds)]
    velocity = np.c_[rng.uniform(2.4, 3.2, birds), rng.uniform(-0.4, 0.4, birds)]
    phase, sky = rng.uniform(0, 2 * np.pi, birds), clouds(shape, rng, 10.0).astype(np.float32)
    places = start + velocity * np.arange(frames)[:, None, None]
    pictures = []
    for f in range(frames):
        picture = sky.copy()
        for at, beat in zip(places[f], np.sin(phase + 0.9 * f), strict=True):
            if thin:
                cv2.ellipse(picture, _fine(at).tolist(), (int(19.2 * span), 77), 0, 0, 360, 50.0, -1, cv2.LINE_AA, 6)
                for side in (-0.45, 0.45):
                    wing = [(0, 0), (side / 2, -0.1 - 0.1 * beat), (side, -0.5 * beat)]
                    cv2.polylines(picture, [_fine(at + span * np.array(wing))], False, 55.0, 2, cv2.LINE_AA, 6)
            else:
                for part in goose(beat):
                    cv2.fillPoly(picture, [_fine(at + span * part)], 50.0, cv2.LINE_AA, 6)
        picture = cv2.GaussianBlur(picture, (0, 0), 0.6) + rng.normal(0, 2, shape)
        pictures.append(np.clip(picture, 0, 255).astype(np.uint8))
    return places, pictures


def _fine(points):
    """In 64ths of a pixel."""
    return np.round(64 * np.asarray(points)).astype(np.int32)
