"""Refuse words that the notation of this project replaces: `docs/explanation/notation.md`.

Without arguments, checks every tracked text file; with arguments, those files.
"""

import re
import subprocess
import sys
from pathlib import Path

ENDINGS = {".py", ".md", ".rst", ".toml", ".html", ".j2", ".yml", ".yaml"}
EXEMPT = {
    "tools/check_words.py",
    "docs/explanation/notation.md",
    "docs/development/architecture.md",
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
