"""Print how the packages import each other: packages, floors, arrows, arrows that run up, cycles.

The floors are the layers contracts of pyproject.toml. Imports within functions and under
TYPE_CHECKING count. The exit status is 1 if an arrow runs up or a cycle exists.
"""

from __future__ import annotations

import sys
import tomllib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import grimp

PROJECT = Path(__file__).parent.parent


@dataclass(frozen=True)
class Structure:
    """A top-level package with its floors, and the imports within it."""

    root: str
    floors: list[list[str]]
    """Names of the packages on each floor, the highest floor first."""
    imports: dict[str, set[str]]
    """For each module, the modules of the same top-level package that it imports."""

    @cached_property
    def packages(self) -> set[str]:
        """Names of the modules and packages directly below the top-level package."""
        return {module.split(".")[1] for module in self.imports if "." in module}

    @cached_property
    def arrows(self) -> set[tuple[str, str]]:
        """Pairs of packages of which the first imports the second."""
        pairs = {
            (importer.split(".")[1], imported.split(".")[1])
            for importer, modules in self.imports.items()
            for imported in modules
            if "." in importer and "." in imported
        }
        return {(importer, imported) for importer, imported in pairs if importer != imported}

    @cached_property
    def upward(self) -> list[tuple[str, str]]:
        """Arrows that do not run to a lower floor."""
        floor = {name: number for number, names in enumerate(self.floors) for name in names}
        return sorted(arrow for arrow in self.arrows if floor[arrow[0]] >= floor[arrow[1]])

    @cached_property
    def cycles(self) -> list[list[str]]:
        """Groups of modules that import each other, directly or through others of the group."""
        return [sorted(group) for group in _strong_components(self.imports) if len(group) > 1]


def read_structures() -> list[Structure]:
    """Read the imports of each top-level package that has a layers contract."""
    tables = tomllib.loads((PROJECT / "pyproject.toml").read_text())["tool"]["importlinter"]
    contracts = [item for item in tables["contracts"] if item["type"] == "layers"]
    return [_read_structure(*item["containers"], item["layers"]) for item in contracts]


def _read_structure(root: str, layers: list[str]) -> Structure:
    graph = grimp.build_graph(root, cache_dir=None)
    imports = {name: graph.find_modules_directly_imported_by(name) for name in graph.modules}
    floors = [[name.strip() for name in layer.split("|")] for layer in layers]
    return Structure(root, floors, imports)


def _strong_components(imports: dict[str, set[str]]) -> list[set[str]]:
    """Modules that can reach each other, by Kosaraju's algorithm."""
    order: list[str] = []
    seen: set[str] = set()
    for module in imports:
        _visit(module, imports, seen, order)
    reverse: dict[str, set[str]] = {module: set() for module in imports}
    for importer, modules in imports.items():
        for imported in modules:
            reverse[imported].add(importer)
    groups: list[set[str]] = []
    seen = set()
    for module in reversed(order):
        found: list[str] = []
        _visit(module, reverse, seen, found)
        groups += [set(found)] if found else []
    return groups


def _visit(start: str, edges: dict[str, set[str]], seen: set[str], order: list[str]) -> None:
    """Append what can be reached from the start and was not seen, each after its successors."""
    stack = [] if start in seen else [(start, iter(sorted(edges[start])))]
    seen.add(start)
    while stack:
        module, successors = stack[-1]
        successor = next((name for name in successors if name not in seen), None)
        if successor is None:
            order.append(module)
            stack.pop()
        else:
            seen.add(successor)
            stack.append((successor, iter(sorted(edges[successor]))))


def main() -> int:
    """Print the counts of each top-level package, then each fault."""
    structures = read_structures()
    print(f"{'':10}{'packages':>10}{'floors':>10}{'arrows':>10}{'up':>10}{'cycles':>10}")
    for item in structures:
        counts = map(len, (item.packages, item.floors, item.arrows, item.upward, item.cycles))
        print(f"{item.root:10}" + "".join(f"{count:10}" for count in counts))
    faults = [
        f"{item.root}.{importer} imports {item.root}.{imported}, which is not on a lower floor"
        for item in structures
        for importer, imported in item.upward
    ]
    faults += [f"import cycle: {', '.join(group)}" for item in structures for group in item.cycles]
    for fault in faults:
        print(fault, file=sys.stderr)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
