"""Program files: what they say, what is wrong with them, and that they read back the same."""

import random
import typing

import pytest
from flockbrush.behaviours.amounts import ACCELERATION, HEIGHT, LENGTH, RATE, SLOPE, SPEED, TIME, amount
from flockbrush.behaviours.program import ProgramLibrary, load_program, save_program, shipped_programs
from flockbrush.behaviours.program_writer import program_to_toml, toml
from flockbrush.behaviours.trigger import conditions, dimension_of, plain, read_condition
from flockbrush.engine.problems import ProblemsError

from flockbrush.cli.program_cli import oddities

HEAD = 'schema = "flockbrush.program/1"\n'
TWO = HEAD + '[state.calm]\nbrush = "graze"\n[state.run]\nbrush = "stampede"\n'


def problems(text, name="small.program.toml"):
    """What is said of a file, line by line."""
    with pytest.raises(ProblemsError) as error:
        load_program(text.encode(), name)
    return [str(problem) for problem in error.value.problems]


# amounts -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text, dimension, low, high, own",
    [
        ("20 m", LENGTH, 20, 20, False),
        ("20m", LENGTH, 20, 20, False),
        ("1.5 km", LENGTH, 1500, 1500, False),
        (".5 BL", LENGTH, 0.5, 0.5, True),
        ("8..12 s", TIME, 8, 12, False),
        ("0 .. 0.6 s", TIME, 0, 0.6, False),
        ("2 min", TIME, 120, 120, False),
        ("36 km/h", SPEED, 10, 10, False),
        ("3 BL/s", SPEED, 3, 3, True),
        ("2 m/s^2", ACCELERATION, 2, 2, False),
        ("6 /min", RATE, 0.1, 0.1, False),
        ("-5 m", HEIGHT, -5, -5, False),
        ("45°", SLOPE, 1, 1, False),
        ("30 %", SLOPE, 0.3, 0.3, False),
        (0.3, SLOPE, 0.3, 0.3, False),
    ],
)
def test_amounts_have_units(text, dimension, low, high, own):
    made = amount(text, dimension, ranges=True)
    assert (made.low, made.high, made.own) == (pytest.approx(low), pytest.approx(high), own)


@pytest.mark.parametrize(
    "value, dimension, said",
    [
        (20, LENGTH, 'must be a length such as "20 m"'),
        ("20", LENGTH, "must be a length in m, cm, km, BL"),
        ("20 s", LENGTH, "must be a length in m, cm, km, BL"),
        ("m", LENGTH, 'must be a length such as "20 m"'),
        ("12..8 s", TIME, "must have the lower number first"),
        ("-1 s", TIME, "must be from 0 to 1000000 s"),
        ("9999 m/s", SPEED, "must be from 0 to 1000 m/s"),
        ("1e999 m", LENGTH, "must be from 0 to 1000000 m"),
        (True, SLOPE, "must be a slope"),
        ("1 2 m", LENGTH, "must be a length"),
        ([], TIME, "must be a time"),
        ("٣ m", LENGTH, "must be a length"),
    ],
)
def test_what_is_no_amount_is_answered_with_what_would_be_right(value, dimension, said):
    with pytest.raises(ValueError, match="must") as error:
        amount(value, dimension, ranges=True)
    assert said in str(error.value)


def test_a_range_is_taken_only_where_one_is_drawn():
    with pytest.raises(ValueError, match="must be one number"):
        amount("1..2 m", LENGTH)


# files ---------------------------------------------------------------------------------


def test_a_program_says_states_and_triggers():
    program = shipped_programs().get("stampede")
    assert list(program.states) == ["graze", "stampede", "calm"]
    assert program.beginnings == (("graze", 1.0),)
    assert program.brushes == ["graze", "march", "stampede"] and program.events == ["alarm"]
    assert str(program.states["stampede"].lasts) == "8..12 s"
    assert program.triggers[0].sources == ("graze", "calm") and program.triggers[0].to == "stampede"


@pytest.mark.parametrize(
    "text, said",
    [
        ("", "small.program.toml:1: schema: is missing; a program starts with"),
        ('schema = "flockbrush.brush/1"', "must be 'flockbrush.program/1'"),
        (HEAD, "small.program.toml:1: state: is missing; a program has at least one table [state.NAME]"),
        (TWO + "[states.x]", "6: states: unknown name; write [state.NAME] tables"),
        (HEAD + 'name = "x"\n[state.a]', "2: name: the name of a program is its file name"),
        (HEAD + 'start = "b"\n[state.a]', "2: start: there is no state 'b'; available: a"),
        (HEAD + 'start = { a = 0 }\n[state.a]', "2: start: must be a state, or a table of states and weights above 0"),
        (HEAD + 'titel = "x"\n[state.a]', "2: titel: unknown name; did you mean 'title'?"),
        (HEAD + '[state.a]\nbrush = "no spaces"', "3: state.a.brush: must look like graze"),
        (HEAD + '[state.a]\nfor = "3 s"', "2: state.a: `for` and `then` go together; then is missing"),
        (HEAD + '[state.a]\nthen = "a"', "2: state.a: `for` and `then` go together; for is missing"),
        (HEAD + '[state.a]\nfor = "3 m"\nthen = "a"', "3: state.a.for: must be a time in s, ms, min, h, got '3 m'"),
        (HEAD + '[state.a]\nfor = 3\nthen = "a"', "3: state.a.for: must be a time such as \"8 s\", got 3"),
        (HEAD + '[state.a]\nfor = "3 s"\nthen = "b"', "4: state.a.then: there is no state 'b'"),
        (HEAD + '[state.a]\nlasts = "3 s"', "3: state.a.lasts: unknown name; did you mean 'for'?"),
        (HEAD + '[state.a]\nemits_within = "3 m"', "3: state.a.emits_within: is the radius of an event, but there"),
        (HEAD + '[state."a b"]', "a state's name has letters, digits, - and _"),
        (HEAD + "state = 3", "state: is missing"),
        (TWO + "[trigger]\nto = 'run'", "must be tables [[trigger]]"),
        (TWO + "[[trigger]]\nto = 'run'", "6: trigger[0]: has no condition; give it when = { ... }"),
        (TWO + "[[trigger]]\nto = 'run'\nwhn = { event = 'x' }", "8: trigger[0].whn: unknown name; did you mean 'when"),
        (TWO + "[[trigger]]\nto='run'\nwhen={event=''}", "trigger[0].when.event: must not be empty"),
        (TWO + "[foo]", "6: foo: unknown name; available: description, schema, source, start, state, title, trigger"),
        (HEAD + '[state.a]\nemits = "a b ü"', "3: state.a.emits: must look like alarm, got 'a b ü'"),
        (TWO + "[[trigger]]\nwhen = { event = 'x' }", "trigger[0].to: is missing"),
        (TWO + "[[trigger]]\nto = 'rum'\nwhen = { event = 'x' }", "7: trigger[0].to: there is no state 'rum'"),
        (TWO + "[[trigger]]\nfrom='clam'\nto='run'\nwhen={event='x'}", "7: trigger[0].from: there is no state 'clam'"),
        (TWO + "[[trigger]]\nfrom=['*','calm']\nto='run'\nwhen={event='x'}", "'*' already means every state"),
        (TWO + "[[trigger]]\nform='calm'\nto='run'\nwhen={event='x'}", "form: unknown name; did you mean 'from'?"),
        (TWO + "[[trigger]]\nto='run'\nwhen='wolf'", "8: trigger[0].when: must be a table such as"),
        (TWO + "[[trigger]]\nto='run'\nwhen={}", "is empty; a condition has one of"),
        (TWO + "[[trigger]]\nto='run'\nwhen={seez='wolf'}", "when: there is no condition 'seez'; did you mean"),
        (TWO + "[[trigger]]\nto='run'\nwhen={sees='a',event='b'}", "asks for sees and event at once; write { all ="),
        (TWO + "[[trigger]]\nto='run'\nwhen={sees=''}", "trigger[0].when.sees: must be a name or an array of names"),
        (TWO + "[[trigger]]\nto='run'\nwhen={sees='wolf',witin='3 m'}", "witin: unknown name; did you mean 'within'?"),
        (TWO + "[[trigger]]\nto='run'\nwhen={any=[]}", "when.any: must be an array of conditions"),
        (TWO + "[[trigger]]\nto='run'\nwhen={not={any=[{sees=1}]}}", "trigger[0].when.not.any[0].sees: must be a name"),
        (TWO + "[[trigger]]\nto='run'\nwhen={any=[{event='x'}],sees='y'}", "asks for any and sees at once"),
        (TWO + "[[trigger]]\nto='run'\nwhen={any=[{event='x'}],within='3 m'}", "'any' must be the only key"),
        (TWO + "[[trigger]]\nto='run'\nwhen={share_of_seen_in='rum',at_least=0.5}", "there is no state 'rum'"),
        (TWO + "[[trigger]]\nto='run'\nwhen={share_of_seen_in='run',at_least=2}", "must be above 0 and at most 1"),
        (TWO + "[[trigger]]\nto='run'\nwhen={event='x'}\ndelay='-1 s'", "delay: must be from 0 to 1000000 s"),
    ],
)  # fmt: skip
def test_one_mistake_is_said_with_its_line_and_what_would_be_right(text, said):
    found = problems(text)
    assert any(said in line for line in found), found


def test_everything_wrong_is_said_at_once():
    text = TWO + "[[trigger]]\nto='rum'\nwhen={seez='wolf'}\n[[trigger]]\nto='run'\nwhen={sees='w',within=3}\ndelay='x'"
    assert len(problems(text)) == 4


def test_conditions_are_nested_eight_deep_and_no_deeper():
    def nested(depth):
        return TWO + "[[trigger]]\nto='run'\nwhen=" + "{not=" * depth + "{event='x'}" + "}" * depth

    assert load_program(nested(8).encode(), "a.program.toml").triggers
    assert "nested 8 deep" in problems(nested(9))[0]


def test_a_program_remembers_at_most_eight_things():
    triggers = "".join(f"[[trigger]]\nto='run'\nwhen={{enters='r{k}'}}\n" for k in range(9))
    assert "store times of 9 different things; the maximum is 8" in problems(TWO + triggers)[0]


def test_a_file_of_another_name_is_no_program():
    assert "the name of a program file must be NAME.program.toml" in problems(TWO, "small.toml")[0]


@pytest.mark.parametrize("name", shipped_programs().names())
def test_shipped_programs_are_without_problems_and_read_back_the_same(name):
    from flockbrush.behaviours.brush import shipped

    program = shipped_programs().get(name)
    assert program.title and program.description
    assert set(program.brushes) <= set(shipped().names())
    assert load_program(program_to_toml(program).encode(), f"{name}.program.toml") == program


def test_a_program_is_saved_and_found_in_a_folder(tmp_path):
    program = shipped_programs().get("stampede")
    path = save_program(program, tmp_path)
    library = ProgramLibrary([tmp_path])
    assert path.name == "stampede.program.toml" and library.names() == ["stampede"]
    assert library.get("stampede") == program
    with pytest.raises(ProblemsError, match="there is no program 'stampde'; did you mean 'stampede'"):
        library.get("stampde")
    with pytest.raises(ProblemsError, match="there is no program"):
        library.get("../stampede")


# a fuzzer that knows what a program is made of -------------------------------------------------

NAMES = ("calm", "run", "rest", "walk", "drink")
SAMPLES = {
    LENGTH: ("3 m", "0.5 BL", "40 m"), HEIGHT: ("-1 m", "3 m"), TIME: ("0.1 s", "1 s"), SPEED: ("1 m/s", "2 BL/s"),
    ACCELERATION: ("2 m/s²",), RATE: ("2 /s", "30 /min"), SLOPE: ("10°", 0.2),
}  # fmt: skip


def random_value(rng, word, name, field, states):
    """A value that a field of a condition takes."""
    dimension = dimension_of(field)
    if dimension is TIME and name not in ("level_time", "until") and rng.random() < 0.5:
        return "0.1..0.6 s"
    if dimension is not None:
        return rng.choice(SAMPLES[dimension])
    if name in ("share_of_seen_in", "imitating"):
        return rng.choice([rng.choice(states), rng.sample(states, min(2, len(states)))])
    if name == "since_state":
        return rng.choice(states)
    if name in ("sees", "species", "death_of", "birth_of"):
        return rng.choice(["wolf", "kin", "others", "anyone", ["wolf", "kin"]])
    if name == "over":
        return rng.choice(["ground", "sea"])
    kind = field.annotation
    if kind is int:
        return rng.randint(1, 4)
    if kind is float:
        return rng.choice([0.3, 1])
    assert kind is str or str in typing.get_args(kind), (word, name, kind)
    return rng.choice(["pond", "alarm"])


def random_condition(rng, states, depth=0):
    """A condition as a file has it."""
    kinds = conditions()
    word = rng.choice([w for w, kind in kinds.items() if depth < 3 or not kind.inner])
    kind = kinds[word]
    if kind.inner:
        inner = [random_condition(rng, states, depth + 1) for _ in range(rng.randint(1, 3))]
        return {word: inner[0] if kind.inner == "one" else inner}
    fields = list(kind.model_fields.items())
    needed = [(n, f) for k, (n, f) in enumerate(fields) if not k or f.is_required() or rng.random() < 0.4]
    return {name: random_value(rng, word, name, field, states) for name, field in needed}


def random_program(rng):
    """The text of a program that is right."""
    states = rng.sample(NAMES, rng.randint(1, 5))
    lines = [HEAD.strip()]
    if rng.random() < 0.5:
        lines.append(f"start = {toml({name: rng.randint(1, 5) for name in states})}")
    for name in states:
        lines.append(f"[state.{name}]")
        if rng.random() < 0.6:
            lines.append(f"brush = {toml(rng.choice(['graze', 'march']))}")
        if rng.random() < 0.4:
            lines += ['for = "0.1..0.5 s"', f"then = {toml(rng.choice(states))}"]
        if rng.random() < 0.3:
            lines.append('emits = "alarm"')
    for _ in range(rng.randint(0, 5)):
        lines += ["[[trigger]]", f"to = {toml(rng.choice(states))}"]
        if rng.random() < 0.5:
            lines.append(f"from = {toml(rng.sample(states, rng.randint(1, len(states))))}")
        if rng.random() < 0.4:
            lines.append('delay = "0..0.2 s"')
        lines.append(f"when = {toml(random_condition(rng, states))}")
    return "\n".join(lines) + "\n"


def loaded(text):
    """The program of a text, or None with problems that name the file and say something."""
    try:
        return load_program(text.encode("utf-8", "surrogatepass"), "small.program.toml")
    except ProblemsError as error:
        assert error.problems and all(p.file == "small.program.toml" and p.message for p in error.problems)
        return None


@pytest.mark.parametrize("seed", range(60))
def test_a_random_program_reads_back_the_same(seed):
    rng = random.Random(seed)
    text = random_program(rng)
    program = loaded(text)
    if program is None:  # it asked to remember too much
        assert "remember" in problems(text)[0]
        return
    again = load_program(program_to_toml(program).encode(), "small.program.toml")
    assert again == program
    for trigger in program.triggers:
        assert plain(read_condition(plain(trigger.when))[0]) == plain(trigger.when)


def test_a_changed_copy_of_a_program_goes_with_a_file_of_its_own():
    before = shipped_programs().get("merino")
    after = before.model_copy(update={"title": "Other sheep"})
    assert before.model_copy().source == before.source != after.source
    assert load_program(after.source, "merino.program.toml").title == "Other sheep"


@pytest.mark.parametrize("seed", range(12))
def test_a_random_program_runs(seed):
    """It goes on for half a second, finite, everybody in a state that there is, and twice the same."""
    import numpy as np
    from flockbrush.components import Position, ProgramState
    from flockbrush.engine.state import state_hash
    from small_program import area, goal, world

    rng = random.Random(2000 + seed)
    program = None
    while program is None:
        program = loaded(random_program(rng))
    places = [(2.0 * (k % 4), 2.0 * (k // 4)) for k in range(11)]
    kinds, names = ["sheep"] * 10 + ["wolf"], ["graze"] * 10 + ["march"]
    found = []
    for _ in range(2):
        scene = world(program, places, kinds, names, areas=[area("pond", 0, 0, 3, 3)], goals=[goal("gate", 9, 9)])
        if program.events:
            scene.event(program.events[0])
        scene.run(16)
        state = scene.agents[ProgramState.state]
        assert (state >= 0).all() and (state < len(program.states)).all()
        assert np.isfinite(scene.agents[Position.xyz]).all()
        found.append(state_hash(scene.world))
    assert found[0] == found[1]


@pytest.mark.parametrize(
    ("when", "said"),
    [
        ("{distance_to='x'}", "holds everywhere: give it below or above"),
        ("{distance_to='x',below='2 m',above='2 m'}", "never holds: nothing is above 2 m and below 2 m"),
        ("{all=[{event='x'},{level_time='5 s',until='2 s'}]}", "never holds: until 2 s is before 5 s"),
        ("{share_of_seen_in='zebra/nope',at_least=0.5}", "the program 'zebra' has no state 'nope'"),
        ("{distance_to='x',below='5 m',above='2 m'}", None),
        ("{share_of_seen_in='zebra/bolt',at_least=0.5}", None),
    ],
)
def test_conditions_that_never_change_are_told(when, said):
    program = loaded(TWO + f"[[trigger]]\nto='run'\nwhen={when}")
    found = [str(one) for one in oddities(program, "small.program.toml", ("sheep", "zebra"), shipped_programs())]
    assert len(found) == (said is not None) and (said is None or said in found[0]), found
