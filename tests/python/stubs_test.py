"""The stubs, hsi4d.pyi, have every public name of the module, and no other; signatures agree."""

import ast
import inspect
import re
import unittest

import hsi4d
from support import SOURCE

DUNDERS = {"__init__", "__len__", "__getitem__", "__enter__", "__exit__"}


def is_public(name):
    return not name.startswith("_") or name in DUNDERS or name == "__version__"


def stubs():
    return ast.parse((SOURCE / "python/hsi4d.pyi").read_text())


def arguments_in(function):
    """Names of a stub's arguments without self, and of those that have a default."""
    spec = function.args
    names = [argument.arg for argument in spec.args if argument.arg != "self"]
    return names, names[len(names) - len(spec.defaults):] if spec.defaults else []


def arguments_of(function):
    """Likewise of a function of the module: pybind11 writes its signature as the first line of its docstring."""
    inside = re.match(r"[^(]*\((.*)\) -> ", function.__doc__.splitlines()[0]).group(1)
    names, defaults, depth, begin = [], [], 0, 0
    for i, letter in enumerate(inside + ","):
        depth += (letter in "([{") - (letter in ")]}")
        if letter == "," and depth == 0:
            part = inside[begin:i].strip()
            begin = i + 1
            if part and not part.startswith("*") and not re.match(r"self\b", part):
                names.append(part.split(":")[0].strip())
                if re.search(r" = ", part):
                    defaults.append(names[-1])
    return names, defaults


class Stubs(unittest.TestCase):
    def test_names_of_the_module(self):
        stub_names = set()
        for node in stubs().body:
            if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
                stub_names.add(node.name)
            elif isinstance(node, ast.AnnAssign):
                stub_names.add(node.target.id)
        self.assertEqual(stub_names, {name for name in dir(hsi4d) if is_public(name)})

    def test_names_of_classes(self):
        for node in stubs().body:
            if not isinstance(node, ast.ClassDef):
                continue
            with self.subTest(node.name):
                known = getattr(hsi4d, node.name)
                if issubclass(known, Exception):
                    self.assertEqual([ast.unparse(base) for base in node.bases],
                                     [base.__name__ for base in known.__bases__])
                    continue
                in_stub = {item.name for item in node.body if isinstance(item, ast.FunctionDef)}
                in_module = {name for name in vars(known) if is_public(name)}
                if inspect.getdoc(known.__init__).startswith("Initialize self"):
                    in_module.discard("__init__")  # it cannot be made from Python
                self.assertEqual(in_stub, in_module)

    def test_setters(self):
        for node in stubs().body:
            if not isinstance(node, ast.ClassDef):
                continue
            in_stub = {item.name for item in node.body if isinstance(item, ast.FunctionDef)
                       and any(ast.unparse(decorator).endswith(".setter") for decorator in item.decorator_list)}
            known = getattr(hsi4d, node.name)
            in_module = {name for name, value in vars(known).items()
                         if isinstance(value, property) and value.fset is not None}
            self.assertEqual(in_stub, in_module, node.name)

    def test_arguments(self):
        checked = 0
        for node in stubs().body:
            owner, functions = hsi4d, [node]
            if isinstance(node, ast.ClassDef):
                owner, functions = getattr(hsi4d, node.name), node.body
            for function in functions:
                if not isinstance(function, ast.FunctionDef) or function.decorator_list:
                    continue
                if function.name in {"__len__", "__getitem__", "__enter__", "__exit__"}:
                    continue
                with self.subTest(f"{getattr(owner, '__name__', '')}.{function.name}"):
                    self.assertEqual(arguments_in(function), arguments_of(getattr(owner, function.name)))
                    checked += 1
        self.assertGreater(checked, 40)

    def test_everything_is_explained(self):
        for name in dir(hsi4d):
            value = getattr(hsi4d, name)
            if not is_public(name) or name == "__version__":
                continue
            with self.subTest(name):
                self.assertTrue(value.__doc__ and len(value.__doc__) > 20)
            if not inspect.isclass(value) or issubclass(value, Exception):
                continue
            for member, held in vars(value).items():
                if member.startswith("_"):
                    continue
                with self.subTest(f"{name}.{member}"):
                    text = held.__doc__ or ""
                    self.assertGreater(len(text.splitlines()[-1] if not isinstance(held, property) else text), 5)


if __name__ == "__main__":
    unittest.main()
