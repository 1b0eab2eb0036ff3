"""Refuse words that the notation of this project replaces: `docs/explanation/notation.md`.

Without arguments, checks every tracked text file; with arguments, those files.
"""

import re
import subprocess
import sys
from pathlib import Path

ENDINGS = {".py", ".md", ".rst", ".toml", ".html", ".j2", ".yml", ".yaml"}
#: Files that may hold them, and why.
EXEMPT = {
    "tools/check_words.py": "the list itself",
    "docs/explanation/notation.md": "defines the terms",
    "docs/development/architecture.md": "names the check",
    "src/trueterrain/formats/navigation/sbet.py": "wander angle: the term of SBET",
    "src/trueterrain/geometry/rotations.py": "wander angle",
    "tests/formats/test_navigation.py": "wander angle",
    "src/trueterrain/formats/settings.py": "keys of earlier versions",
    "src/trueterrain/cli/_options.py": "options of earlier versions",
    "src/trueterrain/figures/__init__.py": "figures of earlier versions",
    "tests/test_public_names.py": "names of earlier versions",
    "src/trueterrain/cli/iri.py": "the key share of --json",
    "tests/cli/test_iri.py": "the key share of --json",
    "src/trueterrain/simulate/ground/_debris.py": "the scene key share",
    "tests/simulate/test_debris.py": "the scene key share",
    "studies/response/roads.py": "the scene key share",
    "tests/surface/test_holes.py": "numpy.shares_memory",
}

#: Pattern of a word, in prose and as a part of an identifier, and what to write instead.
WORDS = {
    "told|untold": "observable, unobservable; or: state, give, report",
    "alike|likeness|likest": "similar, correlated; correlation, agreement",
    "shall": "must, is to",
    "manieth": "every n-th",
    "ways?": "path, trajectory, distance, method",
    "wander(?:s|ing|ed)?|restless": "drift, vary; Gauss-Markov process",
    "surprise": "normalised innovation squared",
    "(?<!degrees.of.)freedom": "degrees of freedom",
    "clustering": "design effect",
    "left.over": "residual",
    "held.back": "held out",
    "claim(?:s|ed)?": "reported standard deviation; report, state",
    "settles?|settled": "converge, decay",
    "rounds": "iterations",
    "shares?": "fraction, part",
    "doubt(?:s|ed|ful)?": "flag, warning; flagged",
    "lent|nowhere|houses?|rooms?": "say it plainly",
}
_PATTERN = re.compile(
    "|".join(f"(?P<w{k}>(?<![A-Za-z])(?:{word})(?![a-z]))" for k, word in enumerate(WORDS)),
    re.IGNORECASE,
)


def check_file(path: Path) -> list[str]:
    """Lines of a file that hold such a word, with what to write instead."""
    found = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        for match in _PATTERN.finditer(line):
            instead = list(WORDS.values())[int((match.lastgroup or "w0")[1:])]
            found.append(f"{path}:{number}: {match.group()!r}; write: {instead}")
    return found


def main() -> int:
    """Check files; 1 if a word was found."""
    names = sys.argv[1:]
    if not names:
        listed = subprocess.run(["git", "ls-files"], check=True, capture_output=True, text=True)
        names = listed.stdout.splitlines()
    wanted = [name for name in names if Path(name).suffix in ENDINGS and name not in EXEMPT]
    found = [line for name in wanted if Path(name).is_file() for line in check_file(Path(name))]
    sys.stderr.write("".join(f"{line}\n" for line in found))
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
