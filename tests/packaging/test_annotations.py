"""Public functions are annotated completely; what numba compiles carries no annotations."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

pytestmark = pytest.mark.skipif(
    not (ROOT / "pyproject.toml").is_file(), reason="needs the checkout, not only the tests"
)

# Decorators behind which numba derives the types from every call (lcmchain/jit.py, packs.py,
# lcmchain/dispatch.py and numba's own).
COMPILED = {
    "equation", "strict_equation", "routine", "span_routine", "span_part", "ordered_span_routine",
    "inlined_routine", "uncounted_routine", "uncounted_entry", "kernel_part", "unrolled",
    "standalone_routine", "standalone_loop", "standalone_span_routine",
    "entry", "kernel", "implements", "required", "optional", "njit", "overload", "intrinsic",
    "instruction",
}  # fmt: skip


def decorators(function):
    for node in function.decorator_list:
        node = node.func if isinstance(node, ast.Call) else node
        yield node.attr if isinstance(node, ast.Attribute) else node.id


def public_functions(body, owner=""):
    """(name, node, whether its first argument is the object or the class) of a module's body."""
    for node in body:
        hidden = getattr(node, "name", "_").startswith("_")
        if isinstance(node, ast.ClassDef) and not hidden:
            yield from public_functions(node.body, f"{node.name}.")
        elif isinstance(node, ast.FunctionDef):
            names = set(decorators(node))
            special = node.name.startswith("__") and node.name.endswith("__")
            if (not hidden or special) and not names & COMPILED:
                yield owner + node.name, node, bool(owner) and "staticmethod" not in names


def missing_annotations(function, is_bound):
    given = function.args
    arguments = [*given.posonlyargs, *given.args][is_bound:]
    arguments += [*given.kwonlyargs, *filter(None, (given.vararg, given.kwarg))]
    missing = [argument.arg for argument in arguments if argument.annotation is None]
    return missing + (["return"] if function.returns is None else [])


def incomplete(source: str) -> list[str]:
    return [
        f"{name}: {', '.join(missing)}"
        for name, function, is_bound in public_functions(ast.parse(source).body)
        if (missing := missing_annotations(function, is_bound))
    ]


@pytest.mark.parametrize("room", ["lcmchain", "mapping", "coupling", "fmu"])
def test_public_functions_are_annotated_completely(room):
    files = sorted((ROOT / room).rglob("*.py"))
    assert files
    found = {
        str(file.relative_to(ROOT)): functions
        for file in files
        if (functions := incomplete(file.read_text(encoding="utf-8")))
    }
    assert found == {}


def test_a_missing_annotation_is_found():
    assert incomplete("def f(x: int, *, y) -> int: ...") == ["f: y"]
    assert incomplete("def f(x: int, **z: int): ...") == ["f: return"]
    assert incomplete("class A:\n    def f(self, x) -> None: ...") == ["A.f: x"]
    assert incomplete("class A:\n    def __init__(self): ...") == ["A.__init__: return"]
    assert incomplete("class A:\n    @staticmethod\n    def f(x) -> None: ...") == ["A.f: x"]
    assert incomplete("def _f(x): ...") == incomplete("@kernel\ndef f(x): ...") == []
