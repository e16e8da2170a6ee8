"""Wraps Markdown's prose at 100 columns, as the tests require."""

import re

COLUMNS = 100

# A word; code spans and addresses of links in it stay whole.
WORD = re.compile(r"(?:`[^`]*`|\]\([^)]*\)|\S)+")
MARK = re.compile(r"( *)([-*] |\d+\. )?")


def wrapped(page):
    """The page with too long paragraphs and list items wrapped again; tables, code and headings stay."""
    done, paragraph, fenced = [], [], False
    for line in page.split("\n"):
        fence = line.lstrip().startswith("```")
        if paragraph and (not is_prose(line) or MARK.match(line)[2] or fence or fenced):
            done += fill(paragraph)
            paragraph = []
        if fenced or fence or not is_prose(line):
            done.append(line)
        else:
            paragraph.append(line)
        fenced ^= fence
    return "\n".join(done + fill(paragraph))


def is_prose(line):
    """True when a line outside of code may be wrapped."""
    return bool(line.strip()) and not line.startswith(("#", "|", "    ", "<!--"))


def fill(lines):
    """Lines of a paragraph, wrapped again if one is too long."""
    if all(len(line) <= COLUMNS for line in lines):
        return lines
    mark = MARK.match(lines[0])[0]
    filled = [mark]
    for word in WORD.findall(" ".join(lines)[len(mark) :]):
        gap = "" if filled[-1].endswith(" ") or not filled[-1] else " "
        if len(filled[-1]) + len(gap) + len(word) > COLUMNS and filled[-1].strip():
            filled.append(" " * len(mark))
            gap = ""
        filled[-1] += gap + word
    return filled
