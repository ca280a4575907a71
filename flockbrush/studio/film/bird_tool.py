"""The mode for birds: shows tracks over the clip, corrects them by hand and tracks on from there."""

from __future__ import annotations

import numpy as np
import pygame

from flockbrush.film.bird_marks import Follower
from flockbrush.render.text import words as written
from flockbrush.studio.film.mode import COLOURS, Mode
from flockbrush.studio.theme import chrome, px
from flockbrush.studio.widgets import enabled

GRAB = 13  # pixels of the screen around a bird that belong to it
RING = 9  # pixels of the screen, where there is room
TAILS = (0.0, 120.0)  # frames


class BirdsMode(Mode):
    """Shows and corrects the tracks of birds."""

    name = "birds"
    title = "Birds"
    hint = (
        "Click: add   Drag: move   Drag a number onto a bird: swap, or join tracks   Right click: no bird   "
        "F: track on   N: next track end"
    )

    def __init__(self, window):
        super().__init__(window)
        self.held = None  # ("bird", "number" or "sky"; bird; where it began; where it is now), pixels of the canvas
        self.selected: int | None = None
        self.tail = 30.0
        self._labels: dict[int, pygame.Rect] = {}
        self._follower: Follower | None = None

    def fill(self, column):
        self.count = column.line()
        self.begin = column.button("Track birds", self.follow_all, "Detect and track the birds in the whole clip")
        self.on = column.button(
            "Track on from here",
            self.follow,
            "Track all birds again from this frame on, with your corrections (F)",
        )
        self.stop = column.button("Stop tracking", self.stop_following)
        self.pending = column.line()
        self.fill_bird(column)
        column.slider("Tails", self.tail, *TAILS, lambda v: f"{v:.0f} frames", self.set_tail)
        column.heading("3D")
        column.button("Lift and view", self.lift, "Save, and show the flock in 3D")

    def fill_bird(self, column):
        """Put the controls for the selected bird into the column."""
        column.heading("Bird")
        self.who = column.line("none selected")
        self.ends = column.pair(
            ("First", lambda: self.go_end(0), "Show its first frame"),
            ("Last", lambda: self.go_end(-1), "Show its last frame"),
        )
        self.remove = column.button(
            "No bird from here on",
            lambda: self.take_away(self.window.k),
            "This is not a bird from this frame on (Delete)",
        )
        self.never = column.button("Never a bird", lambda: self.take_away(0), "Delete the whole track")

    def freshen(self):
        birds = self.state.birds
        count = len(birds.at(self.window.k))
        self.count.say(f"{count} here, {len(birds.ids)} tracks")
        if birds.pending is None:
            self.pending.say("")
        else:
            self.pending.say(f"corrected from frame {birds.pending} on")
        self.freshen_bird()
        enabled(self.stop, self._busy)
        enabled(self.begin, not self._busy)
        enabled(self.on, not self._busy and birds.ids)

    def freshen_bird(self):
        """Update the controls for the selected bird."""
        birds = self.state.birds
        if self.selected is not None and self.selected not in birds.ids:
            self.selected = None
        is_selected = self.selected is not None
        self.who.say(
            f"{self.selected}: in {_frames(birds.sights()[self.selected])}" if is_selected else "none selected"
        )
        for button in (*self.ends, self.remove, self.never):
            enabled(button, is_selected)

    # following ----------------------------------------------------------------------------

    @property
    def _busy(self):
        return "birds" in self.window.jobs

    def follow(self):
        """Follow on from the frame shown, or from the first that was put right if that is earlier; asks before all."""
        if self._busy:
            return
        pending = self.state.birds.pending
        k = self.window.k if pending is None else min(pending, self.window.k)
        if k:
            self._follow(k)
        else:
            self.follow_all()

    def follow_all(self):
        """Detect and track the birds in the whole clip; asks when there are some already."""
        if not self.state.birds.ids:
            self._follow(0)
            return
        answers = [("Track again", lambda: self._follow(0)), ("Cancel", None)]
        question = (
            "Track all birds again from the first frame, with your corrections. Tracks loaded from a file are replaced."
        )
        self.window.ask("Track birds", question, answers)

    def _follow(self, k):
        self._follower = self._follower or Follower(self.window.film.again())
        follower, birds_before = self._follower, self.state.birds

        def then(birds):
            if self.state.birds is not birds_before:
                self.window.toasts.say("Birds were corrected in the meantime; track on again.", "warning")
                return
            self.book.do(f"tracked from frame {k}", self.name, k, birds=birds)
            some = f"{len(birds.ids)} birds" if len(birds.ids) != 1 else "one bird"
            no = "No bird could be tracked: birds must be small, and darker or lighter than the sky."
            self.window.toasts.say(f"Tracked {some} from frame {k}." if birds.ids else no)

        self.window.job(
            "birds", f"tracking birds from frame {k}", lambda say: follower.follow(birds_before, k, say), then
        )

    def stop_following(self):
        """Leave the tracks as they are."""
        if self._busy:
            self.window.jobs["birds"].stop()

    # edits --------------------------------------------------------------------------------

    def set_tail(self, frames):
        """How much of their way is shown, frames."""
        self.tail = frames

    def select(self, bird):
        """Look more closely at a bird."""
        self.selected = bird

    def take_away(self, k):
        """The chosen bird is none from frame k on."""
        self._remove(k, self.selected)

    def _remove(self, k, bird):
        if bird is not None:
            after = self.state.birds.remove(k, bird)
            self.edit(f"bird {bird} removed from frame {k}" if k else f"bird {bird} removed", birds=after)

    def go_end(self, which):
        """Show the first or last frame in which the chosen bird is seen."""
        birds = self.state.birds
        if self.selected in birds.ids:
            frames_seen = np.flatnonzero(np.isfinite(birds.px[:, birds.ids.index(self.selected), 0]))
            self.window.go(int(frames_seen[which]))

    def breaks(self):
        """Frames in which a track begins or ends though the film does not, in order."""
        has_place = np.isfinite(self.state.birds.px[..., 0])
        first, last = has_place.argmax(0), len(has_place) - 1 - has_place[::-1].argmax(0)
        return sorted({int(k) for k in first if k > 0} | {int(k) for k in last if k < len(has_place) - 1})

    def next_break(self):
        """Show the next frame in which a track begins or ends."""
        after = [k for k in self.breaks() if k > self.window.k]
        if after:
            self.window.go(after[0])
        else:
            self.window.toasts.say("No track begins or ends after this frame.")

    def lift(self):
        """Show the flock in 3D."""
        if self.state.birds.ids:
            self.window.lifting.begin("tracks.csv")
        else:
            self.window.toasts.say("There are no birds to lift; track them first.", "warning")

    def keys(self):
        return {"f": self.follow, "n": self.next_break, "delete": lambda: self.take_away(self.window.k)}

    # the mouse ----------------------------------------------------------------------------

    def reach(self):
        """How far around a bird a click is on it, pixels."""
        return px(self.window.scale, GRAB)

    def bird_at(self, at):
        """The bird at a pixel of the canvas, or None."""
        return self.near(at, self.state.birds.at(self.window.k), self.reach())

    def _number_at(self, at):
        """The bird whose number is at a pixel, unless the bird itself is."""
        bird, places = self.bird_at(at), self.state.birds.at(self.window.k)
        if bird is not None and np.hypot(*(self.window.at(places[bird]) - at)) < 0.7 * self.reach():
            return None
        return next((b for b, label in self._labels.items() if label.collidepoint(at)), None)

    def press(self, place, at):
        bird, number = self.bird_at(at), self._number_at(at)
        what = "number" if number is not None else "bird" if bird is not None else "sky"
        self.held = what, bird if number is None else number, at, at
        return True

    def drag(self, place, at):
        if self.held is None:
            return
        what, bird, start, last = self.held
        if what == "view" or (what == "sky" and self.far()):
            self.window.view.shift += at - last
            what = "view"
        self.held = what, bird, start, at

    def release(self, place, at):
        far, held, self.held = self.far(), self.held, None
        if held is None or held[0] == "view":
            return
        what, bird, k = held[0], held[1], self.window.k
        if what == "sky":
            self._add(place)
        elif not far:
            self.select(bird)
        elif what == "bird":
            self.select(bird)
            self.edit(f"bird {bird} corrected", birds=self.state.birds.put(k, bird, *self._inside(place)))
        else:
            other = self.bird_at(at)
            if other is not None and other != bird:
                self._put_number(k, bird, other)

    def _put_number(self, k, bird, other):
        """Give a number to another bird: that of a track that broke off joins the two, else they swap theirs."""
        birds = self.state.birds
        if bird in birds.at(k):
            self.edit(f"birds {bird} and {other} swapped", birds=birds.swap(k, bird, other))
            return
        try:
            self.edit(f"birds {bird} and {other} joined", birds=birds.join(bird, other))
            self.select(bird)
        except ValueError as error:
            self.window.toasts.say(f"Not joined: {error}. Swap them in a frame in which both are visible.", "warning")

    def _inside(self, place):
        return tuple(np.clip(place, 0, np.array(self.window.film.size) - 1).tolist())

    def _add(self, place):
        if self.in_picture(place):
            bird = self._lost(place)
            name = self.state.birds.new() if bird is None else bird
            self.edit(
                f"bird {name} {'added' if bird is None else 'found again'}",
                birds=self.state.birds.put(self.window.k, name, *place),
            )
            self.select(name)

    def _lost(self, place):
        """The chosen bird, if it is missing in this frame: a click says where it is."""
        lost = self.selected is not None and self.selected not in self.state.birds.at(self.window.k)
        return self.selected if lost else None

    def click_right(self, place, at):
        bird = self.bird_at(at)
        if bird is not None:
            self._remove(self.window.k, bird)

    # drawing ------------------------------------------------------------------------------

    def moments(self):
        c = chrome(self.window.theme)
        marked = [(k, c.faint) for k in self.breaks()]
        marked += [(k, c.accent) for k in sorted(self.state.birds.corrections)]
        return marked + ([(self.state.birds.pending, c.warning)] if self.state.birds.pending is not None else [])

    def draw(self, canvas):
        birds, k, u = self.state.birds, self.window.k, self.window.scale
        places = {bird: self.window.at(place) for bird, place in birds.at(k).items()}
        if self.held is not None and self.held[0] == "bird" and self.far():
            places[self.held[1]] = self.held[3]
        corrections = birds.corrections.get(k, {})
        if self.tail >= 1:
            for bird in places:
                tail = self.window.at(birds.tail(bird, k, round(self.tail)))
                canvas.line(tail, 1.8 * u, COLOURS[bird % 8], 0.8)
        self._labels = {}
        radius = self._radius(np.array(list(places.values())))
        for bird, at in places.items():
            self._draw_bird(canvas, bird, at, radius, bird in corrections and not corrections[bird][2])
        for bird, place in birds.lost(k).items():
            self._draw_lost(canvas, bird, self.window.at(place), radius)
        if self.held is not None and self.held[0] == "number" and self.far():
            self._draw_number(canvas, self.held[1], self.held[3], keep=False)

    def _radius(self, places):
        """Of the rings: no larger than the birds lie apart."""
        u = self.window.scale
        if len(places) < 2:
            return RING * u
        gaps = np.linalg.norm(places[:, None] - places[None], axis=-1) + np.diag(np.full(len(places), np.inf))
        return float(np.clip(0.5 * np.median(gaps.min(0)), 3.5 * u, RING * u))

    def _draw_bird(self, canvas, bird, at, radius, corrected):
        u, theme = self.window.scale, self.window.theme
        if not -50 < at[0] < canvas.image.shape[1] + 50 or not -50 < at[1] < canvas.image.shape[0] + 50:
            return
        is_selected, thin = bird == self.selected, min(1.0, radius / (RING * u))
        colour, halo, dash = self.look(bird)
        canvas.ring(at, radius, (2.0 + 3.5 * thin if is_selected else 3.6 * thin) * u, halo, 0.8)
        canvas.ring(
            at, radius, (3.0 if is_selected else 1.8) * u, chrome(theme).accent if is_selected else colour, dash=dash
        )
        if corrected:
            canvas.disc(at, 3.4 * u, theme.paper)
            canvas.disc(at, 2.2 * u, chrome(theme).accent)
        if is_selected or radius > 0.6 * RING * u:  # in a throng numbers would hide the birds: zoom in
            self._draw_number(canvas, bird, at + (0.75 * radius, -0.75 * radius))

    def look(self, bird):
        """Colour of a bird's ring, colour of the halo around it, and its dashes or None."""
        return COLOURS[bird % 8], self.window.theme.paper, None

    def _draw_lost(self, canvas, bird, at, radius):
        """Where a track broke off: a dashed ring, whose number can be dragged onto the other half."""
        u = self.window.scale
        canvas.ring(at, radius, 3.0 * u, self.window.theme.paper, 0.7)
        canvas.ring(at, radius, 1.4 * u, COLOURS[bird % 8], dash=(3 * u, 3 * u))
        self._draw_number(canvas, bird, at + (0.75 * radius, -0.75 * radius))

    def _draw_number(self, canvas, bird, corner, keep=True):
        height, theme = px(self.window.scale, 13), self.window.theme
        canvas.words(str(bird), corner, height, theme.ink, anchor=(0, 1), halo=theme.paper)
        if keep:
            tall, wide = written(str(bird), height).shape
            label = pygame.Rect(round(corner[0]), round(corner[1]) - tall, wide, tall)
            self._labels[bird] = label.inflate(px(self.window.scale, 6), px(self.window.scale, 4))


def _frames(count):
    """So many frames, in words."""
    return f"{count} frame{'s' * (count != 1)}"
