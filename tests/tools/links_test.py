"""Links between pages lead to files and headings that are there.

    python3 tests/tools/links_test.py ROOT
"""

import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1]).resolve()
CODE = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)\s]+)\)")


def anchors(text):
    """Names of the headings, as GitHub makes them."""
    headings = (re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", line) for line in re.findall(r"^#{1,6} (.*)$", text, re.MULTILINE))
    return {re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-") for heading in headings}


def broken(page, pages):
    """Links of a page that lead nowhere."""
    for link in LINK.findall(pages[page]):
        if re.match(r"[a-z]+:", link):
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        if not target.exists():
            yield f"{link}: there is no such file"
        elif anchor and target in pages and anchor not in anchors(pages[target]):
            yield f"{link}: there is no such heading"


files = [root / name for name in ("README.md", "CHANGELOG.md")] + sorted(
    file for folder in ("docs", "configs", "tests", "bench", "tools") for file in (root / folder).rglob("*.md"))
texts = {file: CODE.sub("", file.read_text()) for file in files}

# What the check itself says of a page with two bad links, a good one, one in code and one to another site.
sample = root / "README.md"
made = {sample: CODE.sub("", "# A `b` c\n[x](#a-b-c) [y](#a) [z](none.md) [w](https://a.b)\n```\n[v](no.md)\n```\n")}
assert list(broken(sample, made)) == ["#a: there is no such heading", "none.md: there is no such file"]

bad = [f"{page.relative_to(root)}: {problem}" for page in texts for problem in broken(page, texts)]
assert len(texts) > 20 and not bad, "\n".join(bad)
print(f"{len(texts)} pages")
