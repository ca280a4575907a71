"""The herd in glTF as animated nodes: an animal has a jointed body for each species and brush that it has."""

from __future__ import annotations

from functools import cache

import numpy as np

from flockbrush.engine.files import refused
from flockbrush.output.gltf.bodies import scale_of
from flockbrush.output.gltf.records import PHASE, PRESENT, TURN
from flockbrush.output.joints import posture
from flockbrush.render.animal_looks import mesh_of
from flockbrush.runs.snapshots import words_of
from flockbrush.systems.landscape import Landscape

MOST = 1000  # animals: more need the crowd buffer
STEPS = 256  # of a cycle: as finely as joints are posed
HIDDEN = -1  # instead of the number of a body
AT_ONCE = 1e-3  # s between two keyframes of what jumps
SAME = 1e-6  # what changes by less does not move


def check_number(animals: int) -> None:
    """ProblemsError where there are more animals than animated nodes can show."""
    if animals > MOST:
        message = f"animated nodes are limited to {MOST} animals, and this run has {animals}"
        raise refused("--gltf-mode nodes", f"{message}; use --gltf-mode crowd")


class Herd:
    """Writes the animals of a run into a document, one after another.

    Parameters
    ----------
    world : int
        The node whose axes are ours.
    fps : float
    """

    def __init__(self, document, bodies, records, world, fps):
        self.document, self.bodies, self.records, self.fps = document, bodies, records, fps
        self.words, self.wrap = words_of(bodies.simulation), bodies.simulation.world.resource(Landscape).wrap
        self.poses = list(bodies.poses)
        self.root = document.node("Herd", world)
        if not records.slots:
            return
        self.seconds = np.arange(records.frames, dtype=np.float32) / np.float32(fps)
        self.times = document.numbers(self.seconds, bounds=True)
        table = records.by_animal()
        for row, animal in enumerate(records.slots):
            self._animal(animal, records.bodies.of[animal], table[row])
        del table

    def _animal(self, animal, bodies, track):
        codes = {"species": np.array([body.species for body in bodies])[track["body"]], "brush": track["brush"]}
        codes |= {name: track[name] for name in self.records.labels}
        node = self.document.node(f"animal {animal}", self.root, extras={"id": animal} | self._names(codes))
        self._travel(node, np.array(track["place"]))
        self._animate(node, "rotation", np.maximum(track["turn"], -TURN))
        present = (track["flags"] & PRESENT) != 0
        joints = {kind: self._joints(kind, codes["species"] == kind, track) for kind in np.unique(codes["species"])}
        scales = [scale_of(body) for body in bodies]
        for kind, brush in dict.fromkeys(zip(codes["species"].tolist(), codes["brush"].tolist(), strict=True)):
            shown = present & (codes["species"] == kind) & (codes["brush"] == brush)
            inner = self.document.node(self.bodies.brush_name(brush), node, scale=scales[track["body"][0]])
            self._appear(inner, np.where(shown, track["body"].astype(int), HIDDEN), scales)
            self._limbs(inner, self.bodies.looks()[kind], brush, joints[kind])

    def _travel(self, node, places):
        """Keyframes of positions; over the seam of a periodic map an animal leaves the map and returns at once."""
        over = np.diff(places[:, :2], axis=0)
        step = np.round(over / self.wrap) * self.wrap if self.wrap is not None else 0 * over
        jumps = np.flatnonzero(step.any(axis=1))
        if not len(jumps):
            return self._animate(node, "translation", places)
        outside = places[jumps + 1]
        outside[:, :2] -= step[jumps]
        seconds = np.insert(self.seconds, jumps + 1, self.seconds[jumps + 1] - np.float32(AT_ONCE))
        self.document.lists["nodes"][node]["translation"] = places[0].astype(float).tolist()
        numbers = self.document.numbers(np.insert(places, jumps + 1, outside, axis=0))
        return self.document.animate(node, "translation", self.document.numbers(seconds, bounds=True), numbers)

    def _names(self, codes):
        """{name: [[second, word]]}: the names of an animal, and when they changed."""
        return {
            name: [[round(frame / self.fps, 4), self.words[name][code]] for frame, code in changes(numbers)]
            for name, numbers in codes.items()
        }

    def _appear(self, node, body, scales):
        """Give a node the size of the body that is shown in each frame, and none where it is `HIDDEN`."""
        keys = [(frame, 0.0 if number == HIDDEN else scales[number]) for frame, number in changes(body)]
        if keys[1:] or body[0] == HIDDEN:
            self.document.show(node, keys, self.fps)

    def _joints(self, kind, worn, track):
        """{part: (translations, rotations, scales)} of all frames, part -1 the body; each an accessor or a constant.

        While the animal is of another species, the limbs stay as they were before.
        """
        look = self.bodies.looks()[kind]
        track = track[np.maximum(np.maximum.accumulate(np.where(worn, np.arange(len(worn)), -1)), np.argmax(worn))]
        clips = [self.poses[number][1] for number in track["pose"].tolist()]
        steps = np.round(track["phase"] / PHASE * STEPS).astype(int) % STEPS
        frames = [stance(look, clip, step) for clip, step in zip(clips, steps.tolist(), strict=True)]
        places, turns, scales = (np.stack(part) for part in zip(*frames, strict=True))
        turns = np.round(hemisphere(turns) * TURN).astype(np.int16)
        return {
            k - 1: [self._track(values[:, k]) for values in (places, turns, scales)] for k in range(places.shape[1])
        }

    def _track(self, values):
        """(accessor, first value): no accessor for what does not move."""
        values = values if values.dtype == np.int16 else values.astype(np.float32)
        first = values[0].astype(float) / TURN if values.dtype == np.int16 else values[0].astype(float)
        if np.ptp(values.astype(float), axis=0).max() <= SAME:
            return None, first
        return self.document.numbers(values, normalized=values.dtype == np.int16 or None), first

    def _limbs(self, inner, look, brush, joints):
        """The parts of one body below its node; those that other parts carry hang on them."""
        mesh = mesh_of(look)
        nodes: dict[str, int] = {}
        for k in range(-1, len(mesh.parts)):
            name = mesh.parts[k].name if k >= 0 else "body"
            tracks = joints[k]
            rest = {"translation": tracks[0][1], "rotation": unit(tracks[1][1]), "scale": tracks[2][1]}
            changed = {path: values.tolist() for path, values in rest.items() if not np.allclose(values, STILL[path])}
            parent = nodes[mesh.parts[k].parent] if k >= 0 and mesh.parts[k].parent else inner
            if k >= 0 and not mesh.parts[k].parent and mesh.parts[k].kind != "leg":
                parent = nodes["body"]
            nodes[name] = self.document.node(name, parent, mesh=self.bodies.part_mesh(look, k, brush), **changed)
            for path, (accessor, _) in zip(rest, tracks, strict=True):
                if accessor is not None:
                    self.document.animate(nodes[name], path, self.times, accessor)

    def _animate(self, node, path, values):
        accessor, first = self._track(values)
        first = unit(first) if path == "rotation" else first
        self.document.lists["nodes"][node][path] = first.tolist()
        if accessor is not None:
            self.document.animate(node, path, self.times, accessor)


STILL = {"translation": (0.0, 0.0, 0.0), "rotation": (0.0, 0.0, 0.0, 1.0), "scale": (1.0, 1.0, 1.0)}


@cache
def stance(look, clip, step):
    """(translations, quaternions x y z w, scales) of the body and its parts, at a step of a cycle.

    Legs are told against the animal and not against its body, which goes up and down: their feet stay on the ground.
    """
    places, turns, scales = posture(look, clip, step / STEPS)
    for k, part in enumerate(mesh_of(look).parts):
        if part.kind == "leg":
            places[k + 1] += places[0]
    return places, np.roll(turns, -1, axis=1), scales


def hemisphere(turns):
    """Quaternions (frames, joints, 4) with the signs that make them go on smoothly from frame to frame."""
    dots = (turns[1:] * turns[:-1]).sum(axis=-1)
    signs = np.cumprod(np.where(dots < 0, -1.0, 1.0), axis=0)
    return np.concatenate([turns[:1], turns[1:] * signs[..., None]])


def unit(quaternion):
    """A quaternion of length 1."""
    return quaternion / np.linalg.norm(quaternion)


def changes(values) -> list[tuple[int, int]]:
    """[(frame, value)] of the first frame, and of every frame whose value differs from the one before."""
    values = np.asarray(values)
    frames = np.concatenate([[0], np.flatnonzero(values[1:] != values[:-1]) + 1])
    return [(int(frame), values[frame].item()) for frame in frames]
