"""The packages, their rooms, and the imports between them.

A room is a folder of a package, or a module directly in the package. `python -m tests.rooms` prints two measures for
each package: the arrows between rooms, and the share of imports that stay inside a room.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[1]

ROOMS = {
    "vm_programs": "",
    "vm_embedded": "cli > live > output > cameras > detection > field > network > mesh > poses > geometry"
    " > config > borders+files+errors+arrays",
    "vm_workstation": "",
    "vm_export": "",
    "vm_synth": "__main__ > cli > dataset > render > scene > balls, bodies",
    "vm_mesh": "",
    "vm_label": "",
    "vm_train": "__main__ > cli > tuning > look > evaluation, learning > graphs, runs > truth > formats"
    " > boxes, data, scores",
    "vm_calibrate": "",
    "vm_ros": "",
}
"""The rooms of each package, from top to bottom: a room imports only from itself and from rooms further down. A comma
separates rooms of the same level, which do not import each other; a plus joins modules that count as one room. A
package without rooms is flat: all its modules lie directly in its folder."""

PACKAGES = {
    "vm_programs": set[str](),
    "vm_embedded": set[str](),
    "vm_workstation": {"vm_embedded"},
    "vm_export": {"vm_embedded"},
    "vm_synth": {"vm_embedded", "vm_workstation"},
    "vm_mesh": {"vm_embedded", "vm_workstation"},
    "vm_label": {"vm_embedded", "vm_workstation"},
    "vm_calibrate": {"vm_embedded", "vm_workstation"},
    "vm_ros": {"vm_embedded"},
    "vm_train": {"vm_embedded", "vm_workstation", "vm_export", "vm_synth"},
}
"""Packages of the project that each package may import."""


@dataclass(frozen=True)
class Module:
    """A module and the absolute names of all that it imports: anywhere, and while it is being imported."""

    name: str
    path: Path
    imports: frozenset[str]
    at_import: frozenset[str]

    @property
    def package(self) -> str:
        """The top-level package."""
        return self.name.split(".")[0]


def read_package(folder: Path) -> dict[str, Module]:
    """All modules of a package, in all its folders, by name."""
    modules = {}
    for path in sorted(folder.rglob("*.py")):
        parts = (folder.name, *path.relative_to(folder).with_suffix("").parts)
        is_package = parts[-1] == "__init__"
        name = ".".join(parts[:-1] if is_package else parts)
        tree, inside = ast.parse(path.read_text()), name if is_package else name.rpartition(".")[0]
        imports, at_import = (
            frozenset(each for node in nodes for each in _imported_names(node, inside))
            for nodes in (ast.walk(tree), _executed_on_import(tree))
        )
        modules[name] = Module(name, path, imports, at_import)
    return modules


def read_project() -> dict[str, Module]:
    """All modules of the project's packages, by name."""
    folders = (CHECKOUT / ("" if name == "vm_embedded" else "export") / name for name in ROOMS)
    return {name: module for folder in folders for name, module in read_package(folder).items()}


def _imported_names(node: ast.AST, inside: str) -> Iterator[str]:
    """Absolute names that a statement of a module in package `inside` imports: modules, or names in modules."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        parents = inside.split(".")[: len(inside.split(".")) - node.level + 1] if node.level else []
        base = ".".join([*parents, *filter(None, [node.module])])
        yield from (f"{base}.{alias.name}" for alias in node.names)


def _executed_on_import(node: ast.AST) -> Iterator[ast.AST]:
    """The nodes that run when a module is imported: neither functions nor what only type checkers read."""
    yield node
    for child in ast.iter_child_nodes(node):
        types_only = isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING"
        if not types_only and not isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            yield from _executed_on_import(child)


def top_names(names: Iterable[str]) -> set[str]:
    """The top-level packages of absolute names."""
    return {name.split(".")[0] for name in names}


def uses(module: Module, modules: dict[str, Module]) -> set[str]:
    """The modules among `modules` that a module imports, without itself."""
    found = set()
    for name in module.imports:
        while name and name not in modules:
            name = name.rpartition(".")[0]
        found.add(name)
    return found - {"", module.name}


def room_of(module: str) -> str:
    """The room of a module; "" for a package itself and for modules of a flat package."""
    package, *rest = module.split(".")
    if not rest or not ROOMS[package]:
        return ""
    joined = [each for level in ROOMS[package].split(" > ") for each in level.split(", ") if "+" in each]
    return next((each for each in joined if rest[0] in each.split("+")), rest[0])


def levels(package: str) -> dict[str, int]:
    """The level of each room of a package, 0 at the bottom."""
    rows = [row.split(", ") for row in reversed(ROOMS[package].split(" > "))]
    return {room: level for level, rooms in enumerate(rows) for room in rooms}


def without_room(modules: dict[str, Module]) -> list[str]:
    """Modules that are in no room of the list: in another folder, or in a folder of a flat package."""
    strays = []
    for name in modules:
        package, *rest = name.split(".")
        if rest and (room_of(name) not in levels(package) or (not ROOMS[package] and len(rest) > 1)):
            strays.append(name)
    return strays


def upward_imports(modules: dict[str, Module]) -> list[str]:
    """Imports from a room that is not below the importing one, and of packages that the package may not import.

    The public names of a package, in its own `__init__.py`, are above all rooms.
    """
    found = []
    for module in modules.values():
        order = levels(module.package)
        own = order.get(room_of(module.name), 0) if "." in module.name else len(order)
        for name in sorted(uses(module, modules)):
            other = name.split(".")[0]
            if other != module.package:
                allowed = other in PACKAGES[module.package]
            else:
                level = order.get(room_of(name), 0) if "." in name else len(order)
                allowed = level < own or room_of(name) == room_of(module.name)
            if not allowed:
                found.append(f"{module.name} imports {name}")
    return found


def circles(modules: dict[str, Module]) -> list[str]:
    """Modules that import each other in a circle, or import one that does."""
    remaining = {name: uses(module, modules) for name, module in modules.items()}
    while free := [name for name, needs in remaining.items() if not needs & set(remaining)]:
        for name in free:
            del remaining[name]
    return sorted(remaining)


def importers(modules: dict[str, Module], package: str) -> list[str]:
    """Modules that import a package of others, anywhere in their code."""
    return sorted(name for name, module in modules.items() if package in top_names(module.imports))


def measures(modules: dict[str, Module], package: str) -> tuple[int, float]:
    """The number of pairs of rooms with an import between them, and the share of imports inside a room.

    Neither the public names nor the modules joined by a plus count: all rooms use those.
    """
    members = {
        name: module
        for name, module in modules.items()
        if module.package == package and "." in name and "+" not in room_of(name)
    }
    arrows = [(room_of(name), room_of(other)) for name, module in members.items() for other in uses(module, members)]
    inside = sum(one == other for one, other in arrows)
    return len({pair for pair in arrows if pair[0] != pair[1]}), inside / max(len(arrows), 1)


if __name__ == "__main__":
    project = read_project()
    for package in filter(ROOMS.get, ROOMS):
        between, share = measures(project, package)
        print(f"{package}: {between} arrows between rooms, {share:.0%} of the imports inside rooms")
