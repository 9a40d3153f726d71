"""How easily README and the pages under docs read: `python -m tests.readability`.

A line for each page: words, sentences, mean and largest number of words in a sentence. Then, with
their places, sentences over :data:`LONGEST`, also where they run on over equations and lists, items
of lists that do not end, table cells with more than one number, and acronyms that the glossary does
not resolve. Fences and comments are left out. Pages of the record are listed, not judged.
"""

import re
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
GLOSSARY = ROOT / "docs" / "glossary.md"
MEAN, LONGEST = 20.0, 45  #: words of a sentence
WORDS_OF_README = 900
WORDS_OF_DOCS = 45_000

FENCE = re.compile(r"^ *(`{3,}|~{3,}).*?^ *\1 *$", re.MULTILINE | re.DOTALL)
EQUATION = re.compile(r"\$\$.*?\$\$", re.DOTALL)
COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
LINK = re.compile(r"!?\[([^\]]*)\]\([^)]*\)")
CODE = re.compile(r"`[^`\n]+`")
FORMULA = re.compile(r"\$[^$\n]+\$")
#: What ends with a full stop within a sentence.
SHORTENED = re.compile(r"\b(e\.g|i\.e|cf|vs|eqs?|figs?|no|pp?|al|approx|resp)\.", re.IGNORECASE)
END = re.compile(r"(?<=[.!?])[)\"”']*\s+(?=[\W_]*[A-Z0-9`“])")
WORD = re.compile(r"[^\W_]")
ITEM = re.compile(r"([-*+]|\d+\.) +")
#: What a line ends with where a sentence does.
STOPPED = re.compile(r"[.!?][)\"”’*_]*$")
#: What an item of a list ends with.
CLOSED = re.compile(r"[.!?:][)\"”’*]*$")
#: A number; not the 2 of J2, an exponent, a year in brackets or behind names.
NUMBER = re.compile(r"(?<![\w.,^−–-])(?!(?:19|20)\d\d\b)[−–-]?\d[\d  ]*(?:[.,]\d+)*(?:e[-+−]?\d+)?")
ACRONYM = re.compile(r"\b(?=[A-Z0-9]*[A-Z][A-Z0-9]*[A-Z])[A-Z][A-Z0-9]+s?\b")


@dataclass(frozen=True)
class Sentence:
    """A sentence of a page, and the line where its paragraph begins."""

    line: int
    text: str

    @property
    def num_words(self):
        """Words, a formula or a code span being one."""
        return sum(1 for word in self.text.split() if WORD.search(word))


def pages():
    """README and all pages under docs but those made at a build."""
    found = sorted((ROOT / "docs").rglob("*.md"))
    return [ROOT / "README.md", *(p for p in found if "api" not in p.parts)]


def judged(page):
    """Whether a page has to keep the limits; the record tells what was."""
    return "record" not in page.parts


def plain(text):
    """Text without what is not read as prose; lines stay where they are."""
    for left_out in (FENCE, EQUATION, COMMENT):
        text = left_out.sub(lambda m: "\n" * m[0].count("\n"), text)
    text = LINK.sub(r"\1", text)
    return FORMULA.sub("X", CODE.sub("X", text))


def sentences(text):
    """Sentences of paragraphs and list items; tables and headings are none."""
    found, paragraph, first = [], [], 0
    for number, line in enumerate([*plain(text).splitlines(), ""], 1):
        words = line.strip()
        apart = not words or words.startswith(("#", "|", ">", "---"))
        item = ITEM.match(words)
        if (apart or item) and paragraph:
            found += _split(" ".join(paragraph), first)
            paragraph = []
        if not apart:
            first = first if paragraph else number
            paragraph.append(words[item.end() :] if item else words)
    return found


def runs(text):
    """Sentences that run on where no full stop ends them: over equations, colons, items of lists.

    A symbol of an equation counts as a word. Headings, tables and fences end a sentence.
    """
    text = LINK.sub(r"\1", FENCE.sub("#", COMMENT.sub("", text)))
    text = FORMULA.sub("X", CODE.sub("X", EQUATION.sub(_symbols, text)))
    found, run = [], []
    for line in [*text.splitlines(), "#"]:
        words = line.strip()
        ends = words.startswith(("#", "|", ">", "---"))
        if not ends:
            item = ITEM.match(words)
            run.append(words[item.end() :] if item else words)
            ends = STOPPED.search(words)
        if ends:
            found += _split(" ".join(run), 0)
            run = []
    return found


def _symbols(equation):
    """An equation as that many words, and its full stop where it ends with one."""
    inner = equation[0].strip("$ \n")
    count = sum(1 for word in inner.split() if WORD.search(word))
    return "x " * count + "." * inner.endswith(".")


def open_items(text):
    """(line, end) of list items that end without a full stop, so that their sentence goes on."""
    found, item, first = [], "", 0
    for number, line in enumerate([*plain(text).splitlines(), ""], 1):
        words = line.strip()
        begins = ITEM.match(words)
        if item and (begins or not words or words.startswith("#")):
            if not CLOSED.search(item):
                found.append((first, item))
            item = ""
        if begins:
            item, first = words, number
        elif item:
            item += f" {words}"
    return found


def _split(paragraph, line):
    hidden = SHORTENED.sub(lambda m: m[1] + "\0", paragraph)
    parts = (part.replace("\0", ".").strip() for part in END.split(hidden))
    return [s for part in parts if (s := Sentence(line, part)).num_words]


def crowded_cells(text):
    """(line, cell) of tables whose cell has more than one number."""
    found = []
    for number, line in enumerate(plain(text).splitlines(), 1):
        if line.strip().startswith("|"):
            cells = line.strip().strip("|").split("|")
            found += [(number, c.strip()) for c in cells if len(NUMBER.findall(c)) > 1]
    return found


def acronyms(text):
    """Words of capitals, without a plural's s."""
    return {word.rstrip("s") for word in ACRONYM.findall(plain(text))}


def num_words(text):
    """Words of prose, headings and tables."""
    return sum(1 for word in plain(text).split() if WORD.search(word))


def words_as_shown(text):
    """All words, those of commands and programs too."""
    return sum(1 for word in text.split() if WORD.search(word))


def unresolved():
    """{acronym: a page that has it} of those that the glossary does not name."""
    known = set(re.findall(r"[A-Z][A-Z0-9]+", GLOSSARY.read_text(encoding="utf-8")))
    found = {}
    for page in filter(judged, pages()):
        for word in sorted(acronyms(page.read_text(encoding="utf-8")) - known):
            found.setdefault(word, page)
    return found


def main():
    """Print the table and what is over the limits; status 1 where anything is."""
    total, faults = 0, []
    print(f"{'page':44} words sentences  mean longest")
    for page in pages():
        text, place = page.read_text(encoding="utf-8"), page.relative_to(ROOT)
        found = sentences(text)
        lengths = [s.num_words for s in found] or [0]
        words, mean = num_words(text), sum(lengths) / len(lengths)
        print(f"{place!s:44} {words:5} {len(found):9} {mean:5.1f} {max(lengths):7}")
        if not judged(page):
            continue
        total += words
        if place == Path("README.md") and words_as_shown(text) > WORDS_OF_README:
            faults.append(f"{place}: {words_as_shown(text)} words, expected {WORDS_OF_README}")
        faults += [f"{place}: {mean:.1f} words in the mean sentence"] * (mean > MEAN)
        long = (s for s in found if s.num_words > LONGEST)
        faults += [f"{place}:{s.line}: {s.num_words} words: {s.text[:80]} …" for s in long]
        long = (s for s in runs(text) if s.num_words > LONGEST)
        faults += [f"{place}: {s.num_words} words run on: {s.text[:80]} …" for s in long]
        faults += [f"{place}:{line}: no full stop: {t[-60:]}" for line, t in open_items(text)]
        faults += [f"{place}:{line}: cell: {cell[:80]}" for line, cell in crowded_cells(text)]
    if GLOSSARY.exists():
        faults += [
            f"{page.name}: {word} is not in the glossary" for word, page in unresolved().items()
        ]
    print(f"{total} words in pages that are judged")
    if total > WORDS_OF_DOCS:
        faults.append(f"{total} words in all, expected at most {WORDS_OF_DOCS}")
    print(*faults, sep="\n")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
