"""What is told: one home for all wording, and no decision anywhere that reads a sentence."""

import ast
import inspect
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

import numpy as np
import pytest

import cubicfish
import cubicfish_cli
from cubicfish import Event, Finding, PhotoError, Target
from cubicfish.diagnosis import ObjectFacts
from cubicfish.diagnosis.object_check import Turn
from cubicfish.judge import Code, FindingText, Severity
from cubicfish.judge.codes import Remedy, remedy_of
from cubicfish.judge.finding import level_of, of_record
from cubicfish_cli.words.camera import photo_words
from cubicfish_cli.words.events import OPTIONS, why_ended
from cubicfish_cli.words.phrases import percent
from cubicfish_cli.words.sentences import all_words, parameters, render, with_text
from cubicfish_cli.words.target import advise

PACKAGE = Path(cubicfish_cli.__file__).parent
LIBRARY = Path(cubicfish.__file__).parent
WORDING = Path(__file__).with_name("wording.txt")

# --------------------------------------------------------------------------------- wording

Kind = tuple[str, str]
NAMES = {
    "of_shots": [("0007",)], "cameras": [("left", "right"), ("left",)],
    "images": [("a.png",), ("a.png", "b.png")], "boards": [("floor", "wall"), ("floor",)],
    "rest": [["c.png", "d.png"]], "both": [["floor", "wall"]], "repeats": [[("a.png", "b.png")]],
    "counts": [[{"board": "wall", "columns": 9, "rows": 6, "drawn_columns": 10, "drawn_rows": 6}]],
}  # fmt: skip
TEXTS_OF = {
    "other": "wall", "worst": "b.png", "units": "mm", "real": "25 mm for 24", "scale": "0.50",
    "says": "floor 9x6", "problem": "c.png is empty", "seen": "up to 9x6", "line": "it is",
    "path": "a.yaml", "name": "left", "film": "a.mp4", "folder": "frames", "video": "flat.mp4",
    "ended": "as many as were asked for", "first_square": "light", "first": "right",
    "unseen": "right", "given": "bgr0", "written": "yuv420p", "photo": "b.jpg", "size": "640x480",
    "calibrated": "1280x960",
    "pictures": "2 photos", "refined": "target.refined.yaml",
}  # fmt: skip
ZOOMED = Finding(code=Code.ZOOM, text=FindingText("it is off", do="look"))
# Findings about two boards or cameras.
OF_TWO = (Code.BOARD_NAMES, Code.CLOCKS_DIFFER, Code.FEW_COMMON_SHOTS)
# The finding itself has these.
OF_FINDING = {"images", "boards", "cameras", "of_shots", "code", "case", "board"}


def values_of(name: str, hint: Any) -> list[Any]:
    """Values of a figure: each word that it may be, or a made-up one."""
    if get_origin(hint) is Literal:
        return list(get_args(hint))
    kinds = {bool: [True, False], int: [2, 1], float: [2.0], FindingText: [ZOOMED]}
    if hint in kinds:
        return kinds[hint]
    return NAMES.get(name) or [TEXTS_OF[name]]


def samples(function: Callable[..., Any] | FindingText) -> Iterator[dict[str, Any]]:
    """Figures for a sentence: in each further one a single figure is another."""
    hints = {} if isinstance(function, FindingText) else get_type_hints(function)
    hints.pop("return", None)
    hints = {name: hint for name, hint in hints.items() if name not in {"code", "case", "board"}}
    values = {name: values_of(name, hint) for name, hint in hints.items()}
    if hints.get("photos") is int and inspect.signature(function).parameters["photos"].default == 0:
        values["photos"] = [0, 2]  # of one photo it is not said
    first = {name: some[0] for name, some in values.items()}
    yield first
    for name, some in values.items():
        yield from ({**first, name: one} for one in some[1:])


def finding_of(kind: Kind, figures: dict[str, Any]) -> Finding:
    about = {
        to: figures[name]
        for name, to in (("images", "images"), ("cameras", "cameras"), ("of_shots", "shots"))
        if name in figures
    }
    boards = figures.get("boards", ("floor", "wall"))
    own = {name: value for name, value in figures.items() if name not in OF_FINDING}
    return Finding(code=kind[0], case=kind[1], boards=boards, figures=own, **about)


def lines_of(kind: Kind) -> list[str]:
    findings = [finding_of(kind, figures) for figures in samples(all_words().findings[kind])]
    of_two = kind[1] == "either" or kind[0] in OF_TWO
    enough = [one for one in findings if not of_two or 1 not in (len(one.boards), len(one.cameras))]
    return [render(one).line for one in enough]


AXES = {"x_axis": [1, 0, 0], "y_axis": [0, 1, 0]}
BOARD = {"type": "checkerboard", "corners": [9, 6], **AXES}
SQUARES = {"floor": 30, "tiny": 0.1, "huge": 3000}
CHECKED = Target.from_data(
    {
        "units": "mm",
        "boards": [
            {"name": name, "square": size, "origin": [0, 0, size], **BOARD}
            for name, size in SQUARES.items()
        ],
    }
)


def all_facts() -> Iterator[ObjectFacts]:
    """Facts about targets, so that everything is said of them that can be."""
    turn = Turn(boards=("floor",), onto=("floor",), angle_deg=180.0, axis=np.array([0.0, 0, 1]))
    plain = ObjectFacts(
        corners=54, planes=1, flat=True, named_by="geometry", plain=("floor",), symmetries=(),
        look_alikes=(), crossing=(),
    )  # fmt: skip
    two = replace(plain, plain=("floor", "wall"))
    yield plain
    yield two
    yield replace(plain, symmetries=(turn,) * 6)
    yield replace(two, symmetries=(replace(turn, boards=two.plain, onto=two.plain[::-1]),))
    yield replace(two, flat=False, look_alikes=(two.plain,), crossing=(two.plain,))
    yield replace(two, look_alikes=(two.plain, ("left",), ("right",)))
    yield replace(two, look_alikes=(("left",),))
    yield replace(plain, named_by="markers")
    yield replace(plain, named_by="markers", plain=())
    yield replace(plain, named_by="table")


def all_wording() -> str:
    """Every sentence with made-up figures."""
    known, lines = all_words(), []
    for code, case in known.findings:
        lines.append(f"\n{code}{f' / {case}' * bool(case)}: {remedy_of(code, case)}")
        lines += [f"  {line}" for line in dict.fromkeys(lines_of((code, case)))]
    for title, functions in (("because", known.evidence), ("events", known.events)):
        lines.append(f"\n{title}")
        for key, function in functions.items():
            said = [function(**figures) for figures in samples(function)]
            lines += [f"  {key}: {line}" for line in dict.fromkeys(said)]
    lines.append("\nchecks")
    checks = [f"{topic}: {text}" for facts in all_facts() for topic, text in advise(CHECKED, facts)]
    lines += [f"  {line}" for line in dict.fromkeys(checks)]
    lines.append("\nended")
    lines += [
        f"  {ended}: {why_ended(ended, chosen, 'frame')}"
        for ended in get_args(get_type_hints(why_ended)["ended"])
        for chosen in (1, 2)
    ]
    lines.append("\noptions")
    lines += [f"  {name}: {option}" for name, option in OPTIONS.items()]
    return "\n".join(lines).lstrip() + "\n"


def test_the_wording_is_as_recorded() -> None:
    """Record new words by ``python tests/cubicfish_cli/words/test_words.py``, and look."""
    assert all_wording() == WORDING.read_text(encoding="utf-8")


def test_every_code_has_words_and_all_words_a_code() -> None:
    assert {code for code, _ in all_words().findings} == {*Code} - {Code.UNKNOWN}
    assert set(all_words().events) == {*Event}


def test_sentences_say_the_figures_that_they_ask_for() -> None:
    """A figure that no sentence shows need not be asked for."""
    for key, function in all_words().findings.items():
        if isinstance(function, FindingText):
            continue
        tree = ast.parse(inspect.getsource(function))
        used = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
        assert parameters(function) <= used, key


def test_what_says_take_photos_is_mended_by_photos() -> None:
    """A remedy that programs read and one that people read are the same."""
    for key in all_words().findings:
        photos = any(
            word in line.partition("; ")[2]
            for line in lines_of(key)
            for word in ("take more photos", "take photos", "take three")
        )
        wants = remedy_of(*key) in (Remedy.TAKE_PHOTOS, Remedy.TAKE_AGAIN)
        # Without --hold-out it is the option that helps first; and with the same target photos may.
        others = (Code.NOT_HELD_OUT, ""), (Code.NOTHING_NAMED, "")
        assert wants or not photos or key in others, key


def test_a_remedy_that_begins_otherwise_asks_for_photos_all_the_same() -> None:
    field = Finding(code=Code.SMALL_FIELD, severity=Severity.CARE, figures={"share": 0.04})
    assert not render(field).do.startswith("take")
    assert field.asks_for_photos
    assert not Finding(code=Code.NO_FIGURES).asks_for_photos


def test_a_finding_comes_back_from_its_record_in_its_own_words() -> None:
    finding = Finding(code=Code.TOO_DARK, severity=Severity.CARE, images=("a.png",))
    again = of_record(with_text(finding).as_record())
    assert again is not None
    assert (again.code, again.remedy, again.text) == (finding.code, finding.remedy, render(finding))
    older = {"cause": "zoom", "level": "bad", "what": "zoomed", "evidence": "5 px", "do": "lock it"}
    reported = of_record(older)
    assert reported is not None
    assert (reported.code, reported.severity, str(reported)) == (
        Code.ZOOM, Severity.BAD, "zoomed (5 px); lock it"
    )  # fmt: skip
    newer = of_record({**older, "code": "unheard_of", "remedy": "whatever"})
    assert newer is not None
    assert (newer.code, newer.remedy, render(newer).why) == (
        "unheard_of", Remedy.CHECK, "zoomed (5 px)"
    )  # fmt: skip
    assert of_record({"what": "no level"}) is None


def test_a_level_is_the_largest_severity() -> None:
    note, care, bad = (Finding(code=Code.ZOOM, severity=severity) for severity in Severity)
    assert [level_of(some) for some in ([], [note], [note, care], [care, bad, note])] == [
        "good", "good", "care", "bad"
    ]  # fmt: skip
    assert photo_words([]) == "good"


def test_a_board_that_is_named_board_is_the_board() -> None:
    figures = {"off": 0.01, "real": "30 mm for 30.3"}
    reported = Finding(code=Code.BOARD_SQUARE, boards=("board",), figures=figures)
    assert render(reported).what.startswith("the squares of the board are off by +1 %")


def test_names_of_users_are_no_templates() -> None:
    names = ("{x}|$is_out", "a|b")
    figures = {"size_px": 1.0, "share": 0.5, "worst": "{y}|z"}
    reported = Finding(code=Code.PHOTO_LENS, images=names, figures=figures)
    assert render(reported).what.startswith(
        "{x}|$is_out and a|b differ from the other photos by 1.00 px (RMS)"
    )
    assert render(reported).evidence == "this explains 50 % of the squared error of {y}|z"


def test_an_error_knows_what_it_is_about() -> None:
    error = PhotoError("is empty", do="copy it again", about="a.png")
    assert str(error) == "a.png is empty: copy it again"
    assert str(PhotoError("no field", about="a.png", apart=True)) == "a.png: no field"


# ------------------------------------------------------------------- nobody reads sentences

# What holds sentences, as attributes and as keys of records.
TEXTS = {"what", "evidence", "do", "why", "line", "short", "words", "problem", "notes", "doubts",
         "figures_in_words", "remedy_text"}  # fmt: skip
ERRORS = {"error", "problem", "failure", "exc", "exception", "err", "reason", "why", "note",
          "remark", "finding", "doubt"}  # fmt: skip
READS = {"startswith", "endswith", "partition", "rpartition", "split", "rsplit", "removeprefix",
         "removesuffix", "replace", "find", "rfind", "index", "count", "splitlines"}  # fmt: skip
MATCHES = {"search", "match", "fullmatch", "sub", "findall", "split"}
# Where sentences of other programs and libraries are read, which have no codes: file, function.
FOREIGN = {
    ("workers/cluster.py", "connect"): "what distributed says, on one line",
    ("extension_guard.py", "_read_formats"): "what Python says of a key that no format has",
    ("photos/photos.py", "_decode"): "whether OpenCV's limit of pixels was the reason",
    ("undistortion/map_formats.py", "write_exr"): "why OpenEXR could not write",
}


class Readers(ast.NodeVisitor):
    """Finds decisions and changes that are made by the text of something that is told."""

    def __init__(self) -> None:
        self.found: list[tuple[str, int]] = []
        self._function = [""]
        self._tainted: list[set[str]] = [set()]

    def reported(self, node: ast.AST) -> bool:
        """Whether an expression is, or is made of, a sentence that is told."""
        if isinstance(node, ast.Name):
            return node.id in self._tainted[-1]
        if isinstance(node, ast.Attribute):
            return node.attr in TEXTS
        if isinstance(node, ast.Subscript):
            key = node.slice
            return (isinstance(key, ast.Constant) and key.value in TEXTS) or self.reported(
                node.value
            )
        if isinstance(node, ast.Call):
            function = node.func
            if isinstance(function, ast.Name) and function.id in ("str", "repr"):
                return any(
                    self.reported(one)
                    or (isinstance(one, ast.Name) and one.id in ERRORS)
                    or (isinstance(one, ast.Attribute) and one.attr in ERRORS)
                    for one in node.args
                )
            if isinstance(function, ast.Attribute) and function.attr == "get" and node.args:
                first = node.args[0]
                return isinstance(first, ast.Constant) and first.value in TEXTS
            return isinstance(function, ast.Attribute) and self.reported(function.value)
        if isinstance(node, ast.JoinedStr):
            values = [one.value for one in node.values if isinstance(one, ast.FormattedValue)]
            return any(map(self.reported, values))
        if isinstance(node, ast.BoolOp):
            return any(map(self.reported, node.values))
        if isinstance(node, ast.BinOp):
            return self.reported(node.left) or self.reported(node.right)
        return False

    def _note(self, node: ast.expr) -> None:
        self.found.append((self._function[-1], node.lineno))

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        self._function.append(node.name)
        self._tainted.append(set())
        self.generic_visit(node)
        self._tainted.pop()
        self._function.pop()

    def visit_Assign(self, node: ast.Assign) -> None:
        if self.reported(node.value):
            names = (name for one in node.targets for name in ast.walk(one))
            self._tainted[-1] |= {one.id for one in names if isinstance(one, ast.Name)}
        self.generic_visit(node)

    def visit_For(self, node: ast.For) -> None:
        if self.reported(node.iter) and isinstance(node.target, ast.Name):
            self._tainted[-1].add(node.target.id)
        self.generic_visit(node)

    def visit_comprehension(self, node: ast.comprehension) -> None:
        if self.reported(node.iter) and isinstance(node.target, ast.Name):
            self._tainted[-1].add(node.target.id)
        self.generic_visit(node)

    def _visit_comprehension_first(self, node: Any) -> None:
        for generator in node.generators:
            self.visit(generator)
        self.generic_visit(node)

    visit_ListComp = visit_SetComp = visit_GeneratorExp = visit_DictComp = (
        _visit_comprehension_first
    )

    def visit_Call(self, node: ast.Call) -> None:
        function = node.func
        if isinstance(function, ast.Attribute):
            reads = function.attr in READS and self.reported(function.value)
            regular = isinstance(function.value, ast.Name) and function.value.id == "re"
            if reads or (
                regular and function.attr in MATCHES and any(map(self.reported, node.args))
            ):
                self._note(node)
        self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        sides = [node.left, *node.comparators]
        for left, operator, right in zip(sides, node.ops, sides[1:], strict=False):
            if isinstance(operator, ast.In | ast.NotIn) and self.reported(right):
                self._note(node)
            if isinstance(operator, ast.Eq | ast.NotEq):
                texts = [one.value for one in (left, right) if isinstance(one, ast.Constant)]
                if any(isinstance(text, str) for text in texts) and (
                    self.reported(left) or self.reported(right)
                ):
                    self._note(node)
        self.generic_visit(node)


def readers(source: str) -> list[tuple[str, int]]:
    found = Readers()
    found.visit(ast.parse(source))
    return found.found


@pytest.mark.slow
def test_no_decision_reads_a_sentence() -> None:
    found = [
        f"{name}:{line} in {function}"
        for package in (LIBRARY, PACKAGE)
        for path in sorted(package.rglob("*.py"))
        for name in [path.relative_to(package).as_posix()]
        for function, line in readers(path.read_text(encoding="utf-8"))
        if (name, function) not in FOREIGN
    ]
    assert not found, "decide by codes, not by sentences: " + ", ".join(found)


@pytest.mark.parametrize(
    "code",
    [
        'x = reason.do.startswith("take ")',
        'x = "error" in row.words',
        'x = row.words.replace(" times", "×")',
        'x = f"{str(error).partition(":")[0]}: more"'.replace('":"', "':'"),
        'for doubt in departure["doubts"]:\n    y = str(doubt).partition(":")',
        'x = [doubt.partition(":")[0] for doubt in one.doubts]',
        'names = [n for n, why in unfit.items() if "too few" not in str(why)]',
        'text = str(failure.error)\nif text.startswith("a"):\n    text = text.removeprefix("a")',
        'x = photo.problem == "too dark"',
        'x = re.search("dark", photo.problem)',
        'x = record.get("what").split(";")',
        'x = problems[0].line.lower().endswith("dark")',
    ],
)
def test_what_reads_a_sentence_is_found(code: str) -> None:
    assert readers(code), code


@pytest.mark.parametrize(
    "code",
    [
        "x = reason.remedy is Remedy.TAKE_PHOTOS",
        'x = name.startswith("a") and "b" in path.name',
        'print(f"warning: {finding.line}")',
        "x = photo.problem is None",
    ],
)
def test_what_reads_none_is_not(code: str) -> None:
    assert not readers(code), code


@pytest.mark.parametrize(
    ("share", "said"),
    [(0.0123, "+1.2 %"), (-0.5, "-50 %"), (0.99, "+99 %"), (0.996, "+100 %"), (1.234, "+123 %")],
)
def test_a_share_has_two_digits_or_more(share: float, said: str) -> None:
    assert percent(share) == said


def test_options_are_named_above_the_core_alone() -> None:
    """The core names arguments, and the program knows the option of each."""
    named = set()
    for path in LIBRARY.rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        constants = {
            ast.unparse(node.targets[0]): node.value
            for node in tree.body
            if isinstance(node, ast.Assign)
        }
        for node in ast.walk(tree):
            if isinstance(node, ast.keyword) and node.arg == "arguments":
                value = constants.get(ast.unparse(node.value), node.value)
                assert isinstance(value, ast.Dict)
                named |= {key.value for key in value.keys if isinstance(key, ast.Constant)}
            text = node.value if isinstance(node, ast.Constant) else ""
            # A docstring there names an option of Kalibr's.
            assert path.name == "types.py" or " --" not in f" {text!s}", (path, text)
    assert named == {*OPTIONS}


if __name__ == "__main__":
    WORDING.write_text(all_wording(), encoding="utf-8")
