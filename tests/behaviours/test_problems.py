"""Problems are lines that people can act on."""

from flockbrush.engine.problems import SHOWN, Problem, ProblemsError, did_you_mean


def test_a_problem_says_file_line_key_and_what_would_be_right():
    problem = Problem("sheep.brush.toml", 9, "weights.seperate", "unknown name; did you mean 'separate'?")
    assert str(problem) == "sheep.brush.toml:9: weights.seperate: unknown name; did you mean 'separate'?"


def test_line_and_key_are_left_out_when_nothing_is_known_of_them():
    assert str(Problem("sheep.brush.toml", None, None, "there is no such file")) == (
        "sheep.brush.toml: there is no such file"
    )


def test_all_problems_are_told_at_once_one_a_line():
    error = ProblemsError([Problem("a", 1, None, "x"), Problem("a", 2, "k", "y")])
    assert str(error).splitlines() == ["a:1: x", "a:2: k: y"]


def test_what_several_objects_name_is_told_once():
    error = ProblemsError([Problem("a", 1, None, "x"), Problem("a", 2, None, "x"), Problem("a", 1, None, "x")])
    assert str(error).splitlines() == ["a:1: x", "a:2: x"]


def test_a_file_full_of_mistakes_does_not_fill_the_screen():
    error = ProblemsError([Problem("a", i, None, "x") for i in range(SHOWN + 7)])
    assert len(error.problems) == SHOWN + 7
    assert str(error).splitlines()[SHOWN:] == ["... and 7 more problems"]


def test_a_slip_of_the_pen_is_answered_with_the_word_meant():
    assert did_you_mean("seperate", ["separate", "align"]) == "; did you mean 'separate'?"
    assert did_you_mean("Mill-Filled", ["mill-filled", "march"]) == "; did you mean 'mill-filled'?"
    assert did_you_mean("mill_filled", ["mill-filled", "march"]) == "; did you mean 'mill-filled'?"


def test_a_word_like_no_other_is_answered_with_what_there_is():
    assert did_you_mean("fly", ["walk", "swim"]) == "; available: swim, walk"
    assert did_you_mean("fly", []) == "; available: none"
    assert did_you_mean("x" * 10**6, (f"word{i:02}" for i in range(20))).endswith("word11 and 8 more")
