"""Private modules are imported only from within the package that holds them."""

import ast
from pathlib import Path

import trueterrain

ROOT = Path(trueterrain.__file__).parent


def test_no_package_imports_a_private_module_of_another():
    foreign = []
    for path in sorted(ROOT.rglob("*.py")):
        own = ("trueterrain", *path.relative_to(ROOT).with_suffix("").parts)
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.ImportFrom) or node.level or not node.module:
                continue
            names = [(*node.module.split("."), alias.name) for alias in node.names]
            for parts in names if node.module.startswith("trueterrain") else ():
                private = [k for k, part in enumerate(parts) if part.startswith("_") and k]
                # the last part may be a private function, which mypy and readers see
                for k in private:
                    is_module = (ROOT.joinpath(*parts[1:k], f"{parts[k]}.py")).is_file() or (
                        ROOT.joinpath(*parts[1 : k + 1])
                    ).is_dir()
                    if is_module and own[:k] != parts[:k]:
                        foreign.append(f"{'.'.join(own)} imports {'.'.join(parts)}")
    assert foreign == []
