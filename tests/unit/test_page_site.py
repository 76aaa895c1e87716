"""The site of a gallery: its list and the documents beside it."""

from __future__ import annotations

from pathlib import Path

import pytest
from spectrasplat.base.errors import UserError
from spectrasplat.commands.gallery import _MAKERS, _entries, _key
from spectrasplat.commands.table import Gallery
from spectrasplat.render.page.site import Card, write_documents, write_index
from spectrasplat.render.page.spectra import offered_spectra


def test_documents_point_to_what_is_in_the_site(tmp_path: Path) -> None:
    root, site = tmp_path / "project", tmp_path / "site"
    (root / "docs").mkdir(parents=True)
    (root / "docs" / "a.svg").write_text("<svg/>")
    (root / "README.md").write_text("# Name & title\n\n[more](docs/more.md#a-part) [code](app/x.py) [web](https://a.b)")
    (root / "docs" / "more.md").write_text("# More\n\n## A part\n\n![a](a.svg) [back](../README.md)\n\n|a|\n|-|\n|1|\n")
    assert write_documents(root, site) == "README.html"
    first, more = ((site / name).read_text() for name in ("README.html", "docs/more.html"))
    assert 'href="docs/more.html#a-part"' in first and 'href="https://a.b"' in first and "x.py" not in first
    assert "<title>Name &amp; title</title>" in first
    assert 'id="a-part"' in more and 'href="../README.html"' in more and "<td>1</td>" in more
    assert (site / "docs" / "a.svg").is_file() and 'href="../index.html"' in more
    assert write_documents(tmp_path / "installed", site) is None


def test_what_has_no_page_is_listed_without_a_link(tmp_path: Path) -> None:
    cards = [Card("A <b>", "", "scenes/a.jpg", "scenes/a.html"), Card("C", "no: 'x' is curved", None, None)]
    write_index(tmp_path, {"Scenes": cards}, None)
    text = (tmp_path / "index.html").read_text()
    assert '<a href="scenes/a.html">' in text and "A &lt;b&gt;" in text
    assert "No: &#x27;x&#x27; is curved" in text and text.count("<a ") == 1


def test_names_are_those_of_scenes_and_lessons() -> None:
    assert [entry.page for entry in _entries(["newton", "prism"])] == ["lessons/newton.html", "scenes/prism.html"]
    steps = [step for entry in _entries([]) for step in entry.steps]
    assert steps and all(step["text"] and step["set"].keys() <= {"gain", "nm", "spectrum"} for step in steps)
    assert {step["set"].get("spectrum") for step in steps} <= {None, *offered_spectra()}
    with pytest.raises(UserError, match="did you mean 'prism'"):
        list(_entries(["prysm"]))


def test_a_page_is_made_again_where_its_maker_is_another(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    maker = tmp_path / "page.py"
    maker.write_text("1")
    monkeypatch.setattr("spectrasplat.commands.gallery._MAKERS", (*_MAKERS, tmp_path))
    (prism,), options = _entries(["prism"]), Gallery(scenes=("prism",), output=tmp_path, photons=100)
    before = _key(prism, options)
    assert _key(prism, options) == before
    maker.write_text("2")
    assert _key(prism, options) != before
    assert all(any(folder.glob("page.*")) for folder in _MAKERS)
