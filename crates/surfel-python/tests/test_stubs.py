"""The stubs have the names and signatures of the binary, and every public name has a docstring."""

import ast
import inspect
import pathlib

import pytest
import surfel
from surfel import _native

TREE = ast.parse((pathlib.Path(surfel.__file__).parent / "_native.pyi").read_text())
CLASSES = {node.name: node for node in TREE.body if isinstance(node, ast.ClassDef)}
FUNCTIONS = {node.name: node for node in TREE.body if isinstance(node, ast.FunctionDef)}


def parameters_of_stub(node):
    """Names and kinds, and whether each has a default."""
    kinds = inspect.Parameter
    arguments = node.args
    positional = arguments.posonlyargs + arguments.args
    n_required = len(positional) - len(arguments.defaults)
    found = [(argument.arg, kinds.POSITIONAL_OR_KEYWORD, n_required <= i) for i, argument in enumerate(positional)]
    if arguments.vararg:
        found.append((arguments.vararg.arg, kinds.VAR_POSITIONAL, False))
    pairs = zip(arguments.kwonlyargs, arguments.kw_defaults)
    found += [(argument.arg, kinds.KEYWORD_ONLY, default is not None) for argument, default in pairs]
    if arguments.kwarg:
        found.append((arguments.kwarg.arg, kinds.VAR_KEYWORD, False))
    return [parameter for parameter in found if parameter[0] not in ("self", "cls")]


def parameters_of_binary(function):
    parameters = inspect.signature(function).parameters.values()
    empty = inspect.Parameter.empty
    found = [(parameter.name, parameter.kind, parameter.default is not empty) for parameter in parameters]
    return [parameter for parameter in found if parameter[0] != "self"]


def public(names):
    return {name for name in names if not name.startswith("_")}


def test_the_binary_has_the_names_of_the_stubs():
    names = public(dir(_native))
    assert names == public(set(CLASSES) | set(FUNCTIONS)) - {"Buffer"}
    for name, node in CLASSES.items():
        if name != "Buffer":
            stub = {part.name for part in node.body}
            assert public(dir(getattr(_native, name))) == public(stub), name


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_have_the_parameters_of_the_stubs(name):
    assert parameters_of_binary(getattr(_native, name)) == parameters_of_stub(FUNCTIONS[name])


@pytest.mark.parametrize("name", CLASSES.keys() - {"Buffer"})
def test_methods_have_the_parameters_of_the_stubs(name):
    binary = getattr(_native, name)
    for part in CLASSES[name].body:
        is_property = any(getattr(decorator, "id", "") == "property" for decorator in part.decorator_list)
        member = inspect.getattr_static(binary, part.name)
        assert is_property == inspect.isdatadescriptor(member), part.name
        if part.name == "__new__":
            assert parameters_of_binary(binary) == parameters_of_stub(part), name
        elif not is_property and not part.name.startswith("__"):
            assert parameters_of_binary(getattr(binary, part.name)) == parameters_of_stub(part), part.name


def test_every_public_name_has_a_docstring():
    for name in public(surfel.__all__):
        value = getattr(surfel, name)
        assert inspect.getdoc(value), name
        if inspect.isclass(value) and value.__module__ == "surfel" and not issubclass(value, Exception):
            for member in public(dir(value)):
                assert inspect.getdoc(getattr(value, member)), f"{name}.{member}"


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (surfel.Cloud, ["(N, 3)", "`crs`", "in the unit of the positions", "Raises `InvalidArray`"]),
        (surfel.Mesh, ["(M, 3)", "counter-clockwise", "Raises `InvalidArray`"]),
        (surfel.Scene, ["keys of scene files", "Raises `InvalidSetting`"]),
        (surfel.Movie, ["`turntable`", "Raises `InvalidSetting`"]),
    ],
)
def test_help_about_a_class_says_what_it_takes(value, words):
    assert [word for word in words if word not in value.__doc__] == []


def test_the_package_is_typed():
    assert (pathlib.Path(surfel.__file__).parent / "py.typed").exists()


def test_objects_do_not_change():
    for value in (surfel.Scene(), surfel.Cloud([[0, 0, 0]])):
        with pytest.raises(AttributeError):
            value.color = 1
