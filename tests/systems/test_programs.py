"""The rules of programs: which trigger counts, delays, durations, chance, and what commands do."""

import numpy as np
import pytest
from flockbrush.behaviours import trigger
from flockbrush.behaviours.amounts import Length
from flockbrush.behaviours.program import shipped_programs
from flockbrush.behaviours.trigger import Condition, condition, conditions, field
from flockbrush.components import BrushBinding, ProgramState
from flockbrush.engine.commands import CommandError, Commands
from flockbrush.engine.plugins import PluginError
from flockbrush.engine.state import state_hash
from flockbrush.levels.build import build
from flockbrush.levels.schema import Level, Spawn
from flockbrush.systems.commands import AddAnimals, PaintBrush, RemoveAnimals
from flockbrush.systems.edits import MarkSpawn, UseBrush
from flockbrush.systems.program_commands import Event, ForgetProgram, GiveProgram, SetState, UseProgram
from flockbrush.systems.program_reports import reason
from flockbrush.systems.programs import Programs
from pydantic import field_validator
from small_program import SIZE, area, box, brushes, program, put, states, two_states, world

import flockbrush

HERE, FAR = (0, 0), (60, 0)
GO = "when = { event = 'go' }"


def changes(scene, ticks):
    """(tick, state) of the first animal whenever its state changes."""
    found, last = [], states(scene)[0]
    for _ in range(ticks):
        scene.run(1)
        now = states(scene)[0]
        if now != last:
            found.append((scene.clock.tick, now))
        last = now
    return found


# which trigger counts ------------------------------------------------------------------


def test_of_two_triggers_in_one_tick_the_first_in_the_file_counts():
    one, two = f"[[trigger]]\nfrom = 'a'\nto = 'b'\n{GO}\n", f"[[trigger]]\nfrom = 'a'\nto = 'c'\n{GO}\n"
    for triggers, expected in ((one + two, "b"), (two + one, "c")):
        scene = world(program("[state.a]\n[state.b]\n[state.c]\n" + triggers), [HERE])
        scene.event("go")
        scene.run(1)
        assert states(scene) == [expected]


def test_a_trigger_leads_only_out_of_its_states_and_one_step_a_tick():
    text = f"[state.a]\n[state.b]\n[state.c]\n[[trigger]]\nfrom='a'\nto='b'\n{GO}\n[[trigger]]\nfrom='b'\nto='c'\n{GO}"
    scene = world(program(text), [HERE])
    for expected in ("b", "c", "c"):
        scene.event("go")
        scene.run(1)
        assert states(scene) == [expected]


def test_a_trigger_without_from_leads_out_of_every_other_state():
    scene = world(program(f"[state.a]\n[state.b]\n[[trigger]]\nto = 'b'\n{GO}"), [HERE])
    assert [k for k in range(4) if scene.event("go") or changes(scene, 1)] == [0]


def test_a_trigger_into_its_own_state_begins_it_anew():
    scene = world(
        program(f"[state.a]\nfor = '1 s'\nthen = 'b'\n[state.b]\n[[trigger]]\nfrom='a'\nto='a'\n{GO}"), [HERE]
    )
    scene.submit(Event("go"), tick=20)
    assert changes(scene, 60) == [(20 + 32 + 1, "b")]


def test_a_delay_runs_from_the_condition_to_the_change():
    scene = world(program(f"[state.a]\n[state.b]\n[[trigger]]\nto = 'b'\ndelay = '0.5 s'\n{GO}"), [HERE])
    scene.submit(Event("go"), tick=4)
    scene.submit(Event("go"), tick=12)  # while it runs it does not begin again
    assert changes(scene, 40) == [(4 + 16 + 1, "b")]


def test_an_earlier_trigger_takes_the_place_of_one_whose_delay_runs_and_a_later_one_does_not():
    text = "[state.a]\n[state.b]\n[state.c]\n[[trigger]]\nto='b'\ndelay='0.25 s'\nwhen={event='one'}\n"
    text += "[[trigger]]\nto='c'\ndelay='0.5 s'\nwhen={event='two'}\n"
    for first, second, expected in (("two", "one", "b"), ("one", "two", "b")):
        scene = world(program(text), [HERE])
        scene.submit(Event(first), tick=0)
        scene.submit(Event(second), tick=2)
        assert changes(scene, 16)[0][1] == expected


def test_a_state_ends_after_its_time_and_a_trigger_comes_before_that():
    text = "[state.a]\nfor = '0.5 s'\nthen = 'b'\n[state.b]\n[state.c]\n[[trigger]]\nfrom='a'\nto='c'\n" + GO
    assert changes(world(program(text), [HERE]), 40) == [(17, "b")]
    scene = world(program(text), [HERE])
    scene.submit(Event("go"), tick=16)
    assert changes(scene, 40) == [(17, "c")]


def test_durations_delays_and_beginnings_are_drawn_by_each_animal_and_do_not_depend_on_others():
    text = "start = { a = 3, b = 1 }\n[state.a]\nfor = '0.2..1 s'\nthen = { b = 1, c = 1 }\n[state.b]\n[state.c]\n"
    text += f"[[trigger]]\nto = 'a'\ndelay = '0..0.5 s'\n{GO}"
    places = [(4 * (k % 10), 4 * (k // 10)) for k in range(25)]

    def run(without):
        scene = world(program(text), places)
        begin = states(scene)
        if without is not None:
            scene.world.delete_entity(without)
            scene.world.flush()
        history = []
        for k in range(80):
            if k == 50:
                scene.event("go")
            scene.run(1)
            history.append(dict(zip(scene.agents.ids.tolist(), states(scene), strict=True)))
        return begin, history

    begin, whole = run(None)
    assert {"a", "b"} == set(begin) and begin.count("a") > begin.count("b")
    assert {"b", "c"} <= set(whole[40].values())
    assert len({tuple(sorted(moment.values())) for moment in whole[:40]}) > 6  # not all in one tick
    _, fewer = run(7)
    assert [{k: v for k, v in moment.items() if k != 7} for moment in whole] == fewer


# brushes -------------------------------------------------------------------------------


def test_the_brush_of_a_state_acts_over_paint_and_a_state_without_one_leaves_it_to_the_paint():
    scene = world(
        program(f"[state.a]\n[state.b]\nbrush = 'march'\n[[trigger]]\nto = 'b'\n{GO}"), [HERE, FAR], brush="graze"
    )
    assert brushes(scene) == ["graze", "graze"]
    scene.submit(PaintBrush("march", SIZE / 2, SIZE / 2, 5.0))
    scene.run(2)
    assert brushes(scene) == ["march", "graze"]
    scene.submit(PaintBrush("graze", SIZE / 2, SIZE / 2, 5.0))
    scene.event("go")
    scene.run(2)
    assert brushes(scene) == ["march", "march"]


def test_newborns_begin_in_the_first_state_under_its_brush():
    scene = world(program("[state.run]\nbrush = 'march'\n"), [HERE])
    assert brushes(scene) == ["march"] and scene.agents[BrushBinding.blend].tolist() == [1.0]
    scene.submit(AddAnimals("graze", 120.0, 120.0, 3.0, 2, "sheep", program="small"))
    scene.run(1)
    assert states(scene) == ["run"] * 3 and brushes(scene) == ["march"] * 3


def test_nobody_is_given_a_program_by_which_he_would_fly():
    lake = flockbrush.start("lake")
    commands, before = lake.world.resource(Commands), state_hash(lake.world)
    commands.perform(lake.world, [AddAnimals("rest", 20.0, 20.0, 3.0, 2, "sheep")])
    for command in (
        AddAnimals("rest", 30.0, 30.0, 3.0, 2, "sheep", program="lake-goose"),
        GiveProgram("lake-goose", species="sheep"),
        MarkSpawn(
            90, "pen", [[30, 30], [34, 30], [34, 34], [30, 34]], "rest", species="sheep", program="lake-goose", count=2
        ),
    ):
        with pytest.raises(CommandError, match="lake-goose.*species 'sheep' cannot use brush 'geese', which flies"):
            commands.perform(lake.world, [command])
    commands.perform(lake.world, [GiveProgram("lake-goose", species="goose")])
    assert state_hash(lake.world) != before


def test_a_program_is_not_replaced_by_one_by_which_its_animals_cannot_move():
    scene = world(program("[state.a]"), [HERE])
    aloft = program("[state.a]\nbrush = 'geese'")
    commands = scene.world.resource(Commands)
    geese = flockbrush.shipped().get("geese").source.decode()
    commands.perform(scene.world, [UseBrush("geese", geese)])
    with pytest.raises(CommandError, match="species 'sheep' cannot use brush 'geese', which flies"):
        commands.perform(scene.world, [UseProgram(aloft.name, aloft.source.decode())])
    commands.perform(scene.world, [UseProgram("other", aloft.source.decode())])  # nobody follows it


# commands ------------------------------------------------------------------------------


def done_and_undone(scene, command, ticks=0):
    """State before, after doing, and after undoing a command."""
    commands = scene.world.resource(Commands)
    before = state_hash(scene.world)
    back = commands.perform(scene.world, [command])
    after = state_hash(scene.world)
    scene.run(ticks)
    commands.perform(scene.world, back)
    return before, after, state_hash(scene.world)


@pytest.mark.parametrize(
    "command",
    [
        Event("go"),
        Event("go", 100.0, 100.0, 5.0),
        SetState("small", "moved"),
        SetState("small", "moved", x=100.0, y=100.0, radius=3.0),
        GiveProgram(""),
        GiveProgram("small", species="goat"),
        UseProgram("small", 'schema = "flockbrush.program/1"\n[state.moved]\n[state.new]\n'),
        UseProgram("other", 'schema = "flockbrush.program/1"\n[state.moved]\n[state.new]\n'),
        AddAnimals("graze", 120.0, 120.0, 3.0, 2, "sheep", program="small"),
        RemoveAnimals(100.0, 100.0, 3.0),
    ],
    ids=lambda c: type(c).__name__,
)
def test_every_command_is_undone_to_the_state_before(command):
    scene = world(two_states("{ event = 'go' }"), [HERE, (3, 0), FAR], ["sheep", "sheep", "goat"])
    scene.submit(SetState("small", "moved", x=103.0, y=100.0, radius=1.0))
    scene.run(5)
    before, after, undone = done_and_undone(scene, command)
    assert after != before
    if isinstance(command, AddAnimals):  # ids are not given twice
        assert states(scene) == ["calm", "moved", None]
    else:
        assert undone == before


def test_an_event_taken_back_after_it_was_heard_leaves_everybody_in_the_state_before():
    scene = world(two_states("{ event = 'go' }"), [HERE, FAR])
    back = scene.world.resource(Commands).perform(scene.world, [Event("go")])
    scene.run(3)
    assert states(scene) == ["moved", "moved"]
    scene.world.resource(Commands).perform(scene.world, back)
    assert states(scene) == ["calm", "calm"]
    scene.run(3)
    assert states(scene) == ["calm", "calm"]


def test_a_program_that_is_changed_keeps_animals_in_their_states_by_name():
    scene = world(program(f"[state.a]\n[state.b]\n[state.c]\n[[trigger]]\nfrom='a'\nto='b'\n{GO}"), [HERE, FAR])
    scene.event("go")
    scene.run(1)
    scene.submit(SetState("small", "c", x=SIZE / 2 + 60, y=SIZE / 2, radius=1.0))
    scene.run(1)
    assert states(scene) == ["b", "c"] and scene.transitions()["small"] == {"a": {"b": 2}}
    scene.submit(
        UseProgram("small", 'schema = "flockbrush.program/1"\n[state.x]\n[state.b]\nbrush = "graze"\n[state.a]\n')
    )
    scene.run(2)
    assert states(scene) == ["b", "x"] and brushes(scene) == ["graze", "graze"]
    assert scene.transitions()["small"] == {"a": {"b": 2}}


@pytest.mark.parametrize(
    "command, said",
    [
        (Event("goo"), "no program listens for the event 'goo'; did you mean 'go'?"),
        (Event("go", radius=-1.0), "radius must be at least 0"),
        (SetState("smal", "calm"), "no program 'smal'; it has small"),
        (SetState("small", "clam"), "did you mean 'calm'?"),
        (GiveProgram("stampede"), "this world has no program 'stampede'"),
        (UseProgram("small", "[state.a]"), "schema: is missing"),
        (UseProgram("small", 'schema = "flockbrush.program/1"\n[state.a]\nbrush = "grase"'), "did you mean 'graze'?"),
        (UseProgram("small", 'schema = "flockbrush.program/1"\n[state.a]\n', [[1, 2]]), "counts must be 1 rows"),
    ],
)
def test_a_command_that_cannot_be_done_says_why_and_changes_nothing(command, said):
    scene = world(two_states("{ event = 'go' }"), [HERE])
    before = state_hash(scene.world)
    with pytest.raises(CommandError) as error:
        scene.world.resource(Commands).perform(scene.world, [command])
    assert said in str(error.value) and state_hash(scene.world) == before


def test_a_program_that_somebody_follows_is_not_forgotten():
    scene = world(two_states("{ event = 'go' }"), [HERE])
    scene.world.resource(Commands).perform(scene.world, [ForgetProgram("small")])
    assert scene.world.resource(Programs).names == ["small"]


# replay and snapshots ---------------------------------------------------------------------


def stampede(seed=3, **more):
    """A herd that a wolf frightens, with an event on the way."""
    spawns = [
        Spawn(1, "herd", box(80, 80, 100, 100), "sheep", "graze", 60, program="stampede"),
        Spawn(2, "wolf", box(60, 88, 64, 92), "wolf", "wolf-hunt", 1, 0.0),
        Spawn(3, "late", box(110, 80, 120, 90), "sheep", "graze", 8, start=1.0, rate=4.0, program="stampede"),
    ]
    level = Level("herd", None, SIZE, SIZE, 4.0, "open", seed, spawns=spawns)
    level.programs = {"stampede": shipped_programs().get("stampede")}
    scene = build(level, **more)
    scene.submit(Event("alarm", 110.0, 90.0, 20.0), tick=40)
    scene.submit(RemoveAnimals(90.0, 90.0, 2.0), tick=60)
    return scene


# conditions of a user ---------------------------------------------------------------------


@pytest.fixture
def own_conditions(monkeypatch):
    monkeypatch.setattr(trigger, "_kinds", dict(trigger.conditions()))


@pytest.mark.parametrize("when", ["{{ {0} = 1 }}", "{{ not = {{ {0} = 1 }} }}", "{{ all = [{{ {0} = 1 }}] }}",
                                  "{{ any = [{{ {0} = 1 }}] }}"])  # fmt: skip
@pytest.mark.parametrize(
    ("said", "got"),
    [
        (lambda k: None, "None"),
        (lambda k: True, "true"),
        (lambda k: np.ones(k + 1, bool), r"bool of shape \(3,\)"),
        (lambda k: np.ones(k), r"float64 of shape \(2,\)"),
    ],
)
def test_what_a_condition_must_not_answer_is_told_with_its_name(own_conditions, when, said, got):
    @trigger.condition
    class Odd(trigger.Condition):
        odd: int

        def holds(self, senses, rows):
            return said(len(rows))

    scene = world(two_states(when.format("odd")), [HERE, FAR])
    with pytest.raises(PluginError, match=r"condition 'odd': holds.* must return a bool array of .*\(2,\), got " + got):
        scene.run(1)


def test_what_a_condition_remembers_is_checked_as_its_answer(own_conditions):
    @trigger.condition
    class Recalls(trigger.Condition):
        remembers = True
        recalls: int

        def memory(self):
            return ("recalls",)

        def held(self, senses, rows):
            return None

        def holds(self, senses, rows):
            return np.zeros(len(rows), bool)

    with pytest.raises(PluginError, match=r"condition 'recalls': held.* must return a bool array .* got None"):
        world(two_states("{ recalls = 1 }"), [HERE]).run(1)


def test_a_default_of_a_condition_in_words_is_an_amount(own_conditions):
    @trigger.condition
    class Longish(trigger.Condition):
        longish: Length
        at_most: Length = trigger.field("100 m", "no longer than this")

        def holds(self, senses, rows):
            length = senses.length[rows]
            return (length >= self.longish.of(length)) & (length <= self.at_most.of(length))

    scene = world(two_states('{ longish = "0.5 m" }'), [HERE])
    scene.run(1)
    assert states(scene) == ["moved"]
    (rule,) = scene.world.resource(Programs).programs[0].triggers
    assert trigger.plain(rule.when) == {"longish": "0.5 m"}


# what people are told -----------------------------------------------------------------------


def test_counts_and_transitions_add_up():
    scene = stampede()
    scene.run(200)
    counts, went = scene.states()["stampede"], scene.transitions()["stampede"]
    assert sum(counts.values()) == len(scene.agents) - 1
    assert went["graze"]["stampede"] >= counts["stampede"] > 0


def test_a_state_is_explained_by_what_led_to_it():
    scene = world(
        program(f"[state.a]\n[state.b]\nfor='1 s'\nthen='a'\n[[trigger]]\nname = 'the gate'\nto = 'b'\n{GO}"), [HERE]
    )
    assert reason(scene.world, 0) == ("small", "a", "from the start, for 0.0 s")
    scene.event("go")
    scene.run(17)
    assert reason(scene.world, 0) == ("small", "b", "from a: the gate, for 0.5 s")
    scene.run(20)
    assert reason(scene.world, 0)[2].startswith("after its time in b")
    scene.submit(SetState("small", "b"))
    scene.run(1)
    assert reason(scene.world, 0)[1:] == ("b", "by command, for 0.0 s")
    goat = world(two_states("{ event = 'go' }"), [HERE], "goat")
    assert reason(goat.world, 0) is None


def test_a_region_that_moves_is_asked_where_it_is():
    from flockbrush.systems.commands import MoveGoal
    from small_program import goal

    scene = world(two_states("{ inside = 'pond' }"), [HERE], goals=[goal("pond", 50, 0)])
    scene.run(1)
    scene.submit(MoveGoal("pond", SIZE / 2, SIZE / 2))
    scene.run(2)
    assert states(scene) == ["moved"] and area("a", 0, 0, 1, 1).name == "a" and put(scene, [HERE]) is None
    assert np.isfinite(scene.agents[ProgramState.before]).all()


def test_a_condition_of_others_that_fails_is_named_also_inside_another(monkeypatch):
    class Ominous(Condition):
        ominous: bool = field(True, "fails")

        def holds(self, senses, rows):
            raise KeyError("omen")

    monkeypatch.setattr(trigger, "_kinds", dict(conditions()))
    condition(Ominous)
    scene = world(two_states("{ not = { ominous = true } }"), [(0, 0)])
    with pytest.raises(PluginError, match=r"test_programs.py:[0-9]+: condition 'ominous' of .* KeyError: 'omen'"):
        scene.tick()


@pytest.mark.parametrize(
    ("method", "acts", "words"),
    [
        ("memory", lambda self: 1 / 0, ":[0-9]+: condition 'ominous' of .* failed: ZeroDivisionError"),
        ("memory", lambda self: (["omen"],), "condition 'ominous' of .* failed: TypeError: unhashable type: 'list'"),
        ("references", lambda self: ["omen"], r"condition 'ominous': references\(\) must give Reference, got 'omen'"),
        ("oddity", lambda self: None, r"condition 'ominous': oddity\(\) must return a string"),
    ],
)
def test_a_condition_of_others_that_tells_something_wrong_is_named_as_it_is_read(method, acts, words, own_conditions):
    made = {"__module__": __name__, "__annotations__": {"ominous": bool}, "ominous": field(True, "fails"), method: acts}
    condition(type("Ominous", (Condition,), made))
    with pytest.raises(PluginError, match=f"test_programs.py.*{words}"):
        two_states("{ ominous = true }")


def test_a_class_of_others_that_fails_to_check_its_fields_is_named(own_conditions):
    @condition
    class Ominous(Condition):
        ominous: bool = field(True, "fails")

        @field_validator("ominous")
        @classmethod
        def told(cls, value):
            raise KeyError("omen")

    with pytest.raises(PluginError, match="test_programs.py:[0-9]+: class 'Ominous' of .* failed: KeyError: 'omen'"):
        two_states("{ ominous = true }")
