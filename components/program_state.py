"""Where an animal is in its program."""

import numpy as np
from flockbrush.engine.columns import Component, Field
from flockbrush.engine.limits import PROGRAM_MEMORIES

BY_START, BY_END, BY_COMMAND = -1, -2, -3  # why an animal is in its state, beside the triggers from 0


class ProgramState(Component):
    """State of an animal in its program, since when and why."""

    optional = True
    program = Field(-1, np.int32)  # index into the world's `Programs`; -1: none
    state = Field(0, np.int32)  # number of the state in the program
    brush = Field(-1, np.int32)  # that the state gives; -1: its own or the ground's
    since = Field(0, np.int64)  # tick in which the state was entered
    cause = Field(BY_START, np.int32)  # number of the trigger that led here, or one of `BY_...`
    previous = Field(-1, np.int32)  # state before; -1: none
    pending = Field(-1, np.int32)  # trigger whose delay runs; -1: none
    due = Field(0, np.int64)  # tick at which it ends
    memory = Field(np.zeros(PROGRAM_MEMORIES), np.int64)  # ticks in which what the program remembers last held
    before = Field((0.0, 0.0, 0.0))  # m/s, the velocity one tick ago; kept for programs that ask for acceleration
