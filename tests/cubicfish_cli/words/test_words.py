"""What is told: one home for all wording, and no decision anywhere that reads a sentence."""

import ast
import re
import string
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import cubicfish
import cubicfish_cli
from cubicfish import Event, Finding, PhotoError
from cubicfish.judge import Severity, level_of
from cubicfish.judge.codes import Code, Remedy, remedy_of
from cubicfish.judge.finding import FindingText, of_record
from cubicfish_cli.words.camera import photo_words
from cubicfish_cli.words.catalogue import catalogue
from cubicfish_cli.words.phrases import Sentences, percent
from cubicfish_cli.words.sentences import render, render_event, with_text

PACKAGE = Path(cubicfish_cli.__file__).parent
LIBRARY = Path(cubicfish.__file__).parent
WORDING = Path(__file__).with_name("wording.txt")
SAYINGS = catalogue().finding_texts

# --------------------------------------------------------------------------------- wording

ZOOMED = Finding(code=Code.ZOOM, text=FindingText("it is off", do="look"))
# Figures that are names; all others are numbers.
NAMES = {
    "other": "wall", "worst": "b.png", "units": "mm", "real": "25 mm for 24", "scale": "0.50",
    "first_square": "light", "board": "wall",
    "says": "floor 9x6", "problem": "c.png is empty", "what": "it is",
    "both": ["floor", "wall"], "repeats": ["a.png = b.png"], "light": True, "in_order": True,
    "counts": [{"form": "one", "board": "wall", "columns": 9, "rows": 6, "drawn_columns": 10,
                "drawn_rows": 6}],
}  # fmt: skip
NAMES |= {"rest": ["c.png", "d.png"], "reason": ZOOMED, "first": ZOOMED}
NAMES |= {"path": "a.yaml", "name": "left", "film": "a.mp4", "folder": "frames", "line": "it is"}
NAMES |= {"video": "flat.mp4", "axis": "(0, 0, 1)", "point": "(5, 5, 0)", "moved": "floor → wall"}
NAMES |= {"turned": "Turned by 180°", "onto": "wall", "pairs": "floor and wall", "more_pairs": ""}
NAMES |= {"some": "floor", "alike": "floor could be wall"}
NAMES |= {"cameras": ["left", "right"], "of_shots": ["0007"]}
IMAGES, BOARDS = ("a.png", "b.png"), ("floor", "wall")


def fields(text: str) -> Iterator[str]:
    for _, name, spec, _ in string.Formatter().parse(text):
        if name is not None:
            yield re.split(r"[.[]", name)[0]
            yield from fields(spec or "")


def sample(texts: tuple[str, ...], number: int) -> dict[str, Any]:
    """Figures for some templates: each number is ``number``."""
    values: dict[str, Any] = {}
    for name in (name for text in texts for name in fields(text)):
        phrases = catalogue().phrases.get(name)
        if name in NAMES:
            values[name] = NAMES[name]
        elif phrases is not None:
            values[name] = next(iter(phrases))
            values |= sample(tuple(phrases.values()), number)
            values[name] = next(iter(phrases))
        elif name not in ("images", "boards"):
            values[name] = number
    return values


def all_wording() -> str:
    """Every sentence with made-up figures, of one photo and of two."""
    lines = []
    for (code, case), saying in SAYINGS.items():
        lines.append(f"\n{code}{f' / {case}' * bool(case)}: {remedy_of(code, case)}")
        figures = sample(saying, 2)
        said = [
            render(
                Finding(code=code, case=case, images=IMAGES[:n], boards=BOARDS, figures=figures)
            ).line
            for n in (1, 2)
        ]
        lines += [f"  {line}" for line in dict.fromkeys(said)]
    sentences = Sentences()
    for name, phrases in [("because", catalogue().because), *catalogue().phrases.items()]:
        lines.append(f"\n{name}")
        for key, text in phrases.items():
            values = {**sample((text,), 2), "images": IMAGES, "boards": BOARDS}
            lines.append(f"  {key}: {sentences.vformat(text, (), values)}")
    lines.append("\nchecks")
    for name, text in catalogue().checks.items():
        values = {**sample((text,), 2), "boards": ", ".join(BOARDS)}
        lines.append(f"  {name}: {sentences.vformat(text, (), values)}")
    lines.append("\noptions")
    lines += [f"  {name}: {option}" for name, option in catalogue().options.items()]
    lines.append("\nevents")
    for name, text in catalogue().events.items():
        figures = sample((text,), 2)
        lines.append(f"  {name}: {render_event(Event(name), figures)}")
    return "\n".join(lines).lstrip() + "\n"


def test_the_wording_is_as_recorded() -> None:
    """Record new words by ``python tests/cubicfish_cli/words/test_words.py``, and look."""
    assert all_wording() == WORDING.read_text(encoding="utf-8")


def test_every_code_has_words_and_all_words_a_code() -> None:
    assert {code for code, _ in SAYINGS} == {*Code} - {Code.UNKNOWN}
    assert set(catalogue().events) == {event.value for event in Event}
    phrases = catalogue().phrases
    grids = set(phrases["why"])
    assert grids == set(phrases["help"]) <= {code.value for code in Code}


def test_what_says_take_photos_is_mended_by_photos() -> None:
    """A remedy that programs read and one that people read are the same."""
    for key, saying in SAYINGS.items():
        photos = any(
            word in saying.do for word in ("take more photos", "take photos", "take three")
        )
        wants = remedy_of(*key) in (Remedy.TAKE_PHOTOS, Remedy.TAKE_AGAIN)
        # Without --hold-out it is the option that helps first.
        assert wants or not photos or key == ("not_held_out", ""), key


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
    assert render(reported).what.startswith("the squares of the board are +1 % off")


def test_names_of_users_are_no_templates() -> None:
    names = ("{x}|$is_out", "a|b")
    figures = {"size_px": 1.0, "share": 0.5, "worst": "{y}|z"}
    reported = Finding(code=Code.PHOTO_LENS, images=names, figures=figures)
    assert render(reported).what.startswith(
        "{x}|$is_out and a|b were taken otherwise than the other photos, which moves corners by "
        "1.00 px (RMS)"
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
    ("photos/photos.py", "decode_picture"): "whether OpenCV's limit of pixels was the reason",
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
    """The core names arguments, and the catalogue knows the option of each."""
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
            assert path.name in ("types.py", "pool.py", "shots.py") or " --" not in f" {text!s}", (
                path,
                text,
            )
    assert named == {*catalogue().options}


if __name__ == "__main__":
    WORDING.write_text(all_wording(), encoding="utf-8")
