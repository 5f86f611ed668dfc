"""Moves the helpers that all layers share to vm_embedded/base, and calls rooms layers. Run in the root of a checkout."""

import ast
import re
import subprocess
from pathlib import Path

BASE = "vm_embedded.base"
MOVES = {f"vm_embedded.{name}": f"{BASE}.{name}" for name in ("arrays", "errors", "files")}
MOVES |= {
    f"vm_embedded.borders.{each.stem}": f"{BASE}.{each.stem}" for each in Path("vm_embedded/borders").glob("[a-z]*.py")
}
MOVES |= {f"vm_embedded.cli.{name}": f"{BASE}.{name}" for name in ("program", "progress", "terminal")}
MOVES |= {"vm_embedded.live.http_server": f"{BASE}.http_server"}
INIT = '"""What all layers share: errors, array types, files, text, sockets, and what every program does."""\n'


def git(*words: str) -> str:
    return subprocess.run(["git", *words], check=True, capture_output=True, text=True).stdout


def path_of(module: str) -> str:
    return module.replace(".", "/") + ".py"


def module_of(path: Path) -> tuple[str, bool]:
    parts = path.with_suffix("").parts
    parts = parts[1:] if parts[0] == "export" else parts
    is_package = parts[-1] == "__init__"
    return ".".join(parts[:-1] if is_package else parts), is_package


def relative(target: str, inside: str) -> str:
    """A module as a relative import in a package."""
    one, other = inside.split("."), target.split(".")
    common = 0
    while common < min(len(one), len(other)) and one[common] == other[common]:
        common += 1
    return "." * (len(one) - common + 1) + ".".join(other[common:])


def rewrite(path: Path) -> None:
    """Rewrite the imports of a module, by its old place."""
    name, is_package = module_of(path)
    new_name = MOVES.get(name, name)
    old_inside = name if is_package else name.rpartition(".")[0]
    new_inside = new_name if is_package else new_name.rpartition(".")[0]
    text = path.read_text()
    lines = text.split("\n")
    for node in ast.walk(ast.parse(text)):
        if not isinstance(node, ast.ImportFrom):
            continue
        if node.level:
            parents = old_inside.split(".")[: len(old_inside.split(".")) - node.level + 1]
            source = ".".join([*parents, *filter(None, [node.module])])
        else:
            source = node.module or ""
        target = MOVES.get(source, source)
        names = {alias.name for alias in node.names}
        modules = {each for each in names if f"{source}.{each}" in MOVES}
        if modules:
            if names != modules or len({MOVES[f"{source}.{each}"].rpartition(".")[0] for each in names}) > 1:
                print(f"{path}:{node.lineno}: by hand: from {source} import {', '.join(sorted(names))}")
                continue
            target = BASE
        if target == source and new_inside == old_inside:
            continue
        written = relative(target, new_inside) if node.level else target
        line = lines[node.lineno - 1]
        lines[node.lineno - 1] = re.sub(r"from\s+\S+\s+import", f"from {written} import", line, count=1)
    path.write_text("\n".join(lines))


files = [Path(each) for each in git("ls-files").splitlines()]
for each in files:
    if each.suffix == ".py" and each.is_file():
        rewrite(each)

# Names and paths in texts: strings, documentation, configuration.
names = [(re.compile(rf"\b{re.escape(old)}\b(?!\.md)"), new) for old, new in MOVES.items()]
paths = [(re.compile(rf"\b{re.escape(path_of(old))}\b"), path_of(new)) for old, new in MOVES.items()]
tests = [
    (re.compile(r"\btests([./])vm_embedded\1borders\b"), r"tests\1vm_embedded\1base"),
    (re.compile(r"\btests([./])rooms\b"), r"tests\1layers"),
    (re.compile(r"\btests([./])test_rooms\b"), r"tests\1test_layers"),
    (re.compile(r"for the tests of this room"), "for the tests of this layer"),
]
for each in files:
    if each.suffix in (".py", ".md", ".toml", ".sh", ".yml", ".txt", "") and each.is_file() and not each.is_symlink():
        try:
            text = each.read_text()
        except UnicodeDecodeError:
            continue
        made = text
        for pattern, new in [*names, *paths, *tests]:
            made = pattern.sub(new, made)
        if made != text:
            each.write_text(made)

Path("vm_embedded/base").mkdir()
for old, new in MOVES.items():
    git("mv", path_of(old), path_of(new))
git("rm", "-q", "-f", "vm_embedded/borders/__init__.py")
Path("vm_embedded/base/__init__.py").write_text(INIT)
git("mv", "tests/vm_embedded/borders", "tests/vm_embedded/base")

# Rooms are layers.
git("mv", "tests/rooms.py", "tests/layers.py")
git("mv", "tests/test_rooms.py", "tests/test_layers.py")
for name in ("tests/layers.py", "tests/test_layers.py", "tests/test_docs.py"):
    path = Path(name)
    text = path.read_text()
    text = text.replace(" > config > borders+files+errors+arrays", " > config > base")
    for old, new in (("ROOM", "LAYER"), ("Room", "Layer"), ("room", "layer")):
        text = text.replace(old, new)
    path.write_text(text)


def edit(name: str, *pairs: tuple[str, str]) -> None:
    path = Path(name)
    text = path.read_text()
    for old, new in pairs:
        if old not in text:
            print(f"{name}: by hand, not found: {old[:70]!r}")
        text = text.replace(old, new)
    path.write_text(text)


edit(
    "tests/layers.py",
    (
        " A comma\nseparates layers of the same level, which do not import each other; a plus joins modules that count as one layer. A\n"
        "package without layers is flat: all its modules lie directly in its folder.",
        "\nA comma separates layers of the same level, which do not import each other. A package without layers is flat: all its\n"
        "modules lie directly in its folder.",
    ),
    (
        '    joined = [each for level in LAYERS[package].split(" > ") for each in level.split(", ") if "+" in each]\n'
        '    return next((each for each in joined if rest[0] in each.split("+")), rest[0])\n',
        "    return rest[0]\n",
    ),
    (
        "    Neither the public names nor the modules joined by a plus count: all layers use those.\n",
        "    Neither the public names nor the layer base count: all layers use those.\n",
    ),
    ('and "+" not in layer_of(name)', 'and layer_of(name) != "base"'),
)
edit("tests/test_docs.py", ('r" > |, |\\+", order', 'r" > |, ", order'))
design = Path("docs/design.md")
text = design.read_text()
text = re.sub(r"^\| `borders` \|.*\n", "", text, flags=re.MULTILINE)
text = re.sub(
    r"^\| `files`, `errors`, `arrays` \|.*$",
    "| `base` | what all layers share: errors, array types, files, text, sockets, and what every program does |",
    text,
    flags=re.MULTILINE,
)
design.write_text(text)
edit(
    "docs/design.md",
    ("## The rooms of the code", "## The layers of the code"),
    ("| room | contents |", "| layer | contents |"),
    ("**The room `field`", "**The layer `field`"),
)
for each in (
    git("grep", "-l", "the-rooms-of-the-code").splitlines()
    if subprocess.run(["git", "grep", "-q", "the-rooms-of-the-code"]).returncode == 0
    else []
):
    edit(each, ("the-rooms-of-the-code", "the-layers-of-the-code"))
edit(
    "docs/design.md",
    (
        "A room is a folder of modules. A room imports only from the rooms below it",
        "A layer is a folder of modules. A layer imports only from the layers below it",
    ),
    ("Packages without a table have no rooms.", "Packages without a table have no layers."),
)
edit(
    "tests/vm_embedded/cli/test_program.py",
    (
        "program; print(program(lambda: os.open('/', os.O_RDONLY))())",
        "program; print(program(lambda: os.open('/', 0))())",
    ),
)
edit("vm_embedded/base/program.py", ("# Rooms do not import", "# Layers do not import"))
git("add", "-A")
