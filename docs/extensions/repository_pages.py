"""Links from the pages into the repository work in the site too.

The pages link to files beside them, such as ``../cpp/dqslam/geometry/blocks.h``, which a forge
shows. For the site each such file becomes a page of its own, under ``_generated/source``, and the
links lead there.
"""

import os
import re
import shutil
from pathlib import Path

from sphinx.application import Sphinx

# [text](target#anchor), the target relative and out of a folder's own pages.
_LINK = re.compile(r"(\]\()(?!https?:|mailto:|#)([^)\s#]+)(#[^)\s]*)?\)")
_PAGES = {"README.md": "index.md", "CONTRIBUTING.md": "_generated/contributing.md"}
_PAGES["CHANGELOG.md"] = "_generated/changelog.md"
_PAGES["examples"] = "_generated/gallery/index.rst"
_LANGUAGES = {
    ".py": "python",
    ".pyi": "python",
    ".h": "cpp",
    ".cc": "cpp",
    ".toml": "toml",
    ".txt": "cmake",
    ".yml": "yaml",
    ".cff": "yaml",
}


class _Repository:
    """Rewrites links, and remembers which files of the repository they lead to."""

    def __init__(self, root: Path, docs: Path) -> None:
        self.root = root
        self.docs = docs
        self.linked: set[Path] = set()

    def rewrite(self, text: str, folder: Path, page: Path) -> str:
        """Lead links, relative to a folder, to pages of the site, relative to another page."""

        def new_link(match: re.Match[str]) -> str:
            target = Path(os.path.normpath(folder / match[2]))
            page_of = self._page_of(target)
            if page_of is None:
                return match[0]
            way = os.path.relpath(page_of, page.parent)
            return f"{match[1]}{way}{match[3] or ''})"

        return _LINK.sub(new_link, text)

    def _page_of(self, target: Path) -> Path | None:
        if not target.exists() or not target.is_relative_to(self.root):
            return None  # Sphinx complains of it
        name = target.relative_to(self.root).as_posix()
        if name in _PAGES:
            return self.docs / _PAGES[name]
        if target.is_relative_to(self.docs) and target.suffix != ".py":
            return target
        self.linked.add(target)
        return self.docs / "_generated/source" / f"{name}.md"

    def write_pages(self, folder: Path) -> None:
        """Write a page for each linked file, and for each linked folder a list of its files."""
        shutil.rmtree(folder, ignore_errors=True)
        listed = [path for path in self.linked if path.is_dir()]
        for path in listed:
            self.linked |= {file for file in path.iterdir() if file.suffix in _LANGUAGES}
        for path in sorted(self.linked):
            name = path.relative_to(self.root).as_posix()
            page = folder / f"{name}.md"
            page.parent.mkdir(parents=True, exist_ok=True)
            show = self._list if path.is_dir() else self._show
            # The search of the site finds pages, not lines of source.
            page.write_text(
                f"---\norphan: true\nno-search: true\n---\n\n# {name}\n\n{show(path, page)}"
            )

    def _list(self, path: Path, page: Path) -> str:
        files = sorted(file for file in path.iterdir() if file in self.linked)
        folder = os.path.relpath(page.with_suffix(""), page.parent)
        return "".join(f"- [{file.name}]({folder}/{file.name}.md)\n" for file in files)

    def _show(self, path: Path, page: Path) -> str:
        language = _LANGUAGES.get(path.suffix, "text")
        way = os.path.relpath(path, page.parent)
        return f"```{{literalinclude}} {way}\n:language: {language}\n:linenos:\n```\n"


def _write_pages(app: Sphinx) -> None:
    docs = Path(app.srcdir)
    repository = _Repository(docs.parent, docs)
    app.dqslam_repository = repository
    for name in ("CONTRIBUTING.md", "CHANGELOG.md"):
        page = docs / _PAGES[name]
        page.parent.mkdir(exist_ok=True)
        text = (docs.parent / name).read_text(encoding="utf-8")
        page.write_text(repository.rewrite(text, docs.parent, page), encoding="utf-8")
    for page in (*docs.glob("*.md"), *docs.glob("api/*.md")):
        repository.rewrite(page.read_text(encoding="utf-8"), page.parent, page)
    repository.write_pages(docs / "_generated/source")


def _rewrite(app: Sphinx, docname: str, content: list[str]) -> None:
    if docname.startswith("_generated/"):
        return
    page = Path(app.srcdir) / f"{docname}.md"
    content[0] = app.dqslam_repository.rewrite(content[0], page.parent, page)


def setup(app: Sphinx) -> dict[str, bool]:
    """Write the pages before the sources are read, and rewrite these as they are."""
    # Before Sphinx looks which pages there are.
    app.connect("builder-inited", _write_pages, priority=100)
    app.connect("source-read", _rewrite)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
