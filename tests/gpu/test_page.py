"""Pages: what a file holds, and what is refused. What its scripts draw: tests/interface."""

from __future__ import annotations

import base64
import io
import json
import re
import zlib
from pathlib import Path

import numpy as np
import pytest
import spectrasplat as ss
from interface.page_pixels import BALL
from PIL import Image
from spectrasplat.base.errors import UserError
from spectrasplat.render.export_caustic import check_export
from spectrasplat.render.page.document import packed_bytes
from spectrasplat.render.page.page import check_page, check_page_path, decimated


def test_what_can_be_no_page_says_why(tmp_path: Path) -> None:
    bowl = BALL["objects"][0] | {"name": "bowl", "glass": None, "material": {"kind": "diffuse"}}
    with pytest.raises(UserError, match="'bowl' is not one flat face"):
        check_page(ss.Scene(BALL | {"objects": [*BALL["objects"], bowl]})._model, "bowl")
    with pytest.raises(UserError, match="wears a picture"):
        check_page(ss.load("lens_text")._model, "page")
    with pytest.raises(UserError, match="no receiver of scene 'prism'"):
        check_page(ss.load("prism")._model, "prism")
    for path in (tmp_path / "page.txt", tmp_path / "none" / "page.html"):
        with pytest.raises(UserError, match="cannot write"):
            check_page_path(path)
    with pytest.raises(UserError, match="--plane does not go with a page"):
        check_export(tmp_path / "page.html", plane=True)


def test_a_page_asks_nothing_of_a_network(tmp_path: Path) -> None:
    told: list[float] = []
    page = ss.page(ss.Scene(BALL), size=(64, 36), photons=2000, progress=lambda share, text: told.append(share))
    assert told == sorted(told) and page.head["receiver"] == "table" and page.head["mode"] == "index"
    text = page.to_html(tmp_path / "page.html").read_text(encoding="utf-8")
    assert not re.findall(r"""(?:src|href)=["']?(?!data:)\w+|url\(|@import|fetch\(|import .* from""", text)
    head = json.loads(text.split('id="head">')[1].split("</script>")[0])
    blob = zlib.decompress(base64.b64decode(text.split('id="blob">')[1].split("</script>")[0]))
    listed = head["arrays"]["photons.position"]
    stored = np.frombuffer(blob, listed["dtype"], int(np.prod(listed["shape"])), listed["offset"])
    assert np.array_equal(stored.reshape(listed["shape"]), page.arrays["photons.position"])
    assert "<iframe" in page._repr_html_() and "&lt;!DOCTYPE html&gt;" in page._repr_html_()
    # The photons' places are where the picture's pixels look: the ball's shadow is amid the table.
    weight = np.asarray(Image.open(io.BytesIO(page.arrays["weight"].tobytes())))
    assert weight.shape == (36, 64, 3) and weight[-1].min() > 250 and weight[:18].min() == 0


def test_a_page_has_as_many_photons_as_its_file_has_room_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("spectrasplat.render.page.page._ROOM", 60_000)
    page = ss.page(ss.Scene(BALL), size=(64, 36), photons=4000)
    light = {name: values for name, values in page.arrays.items() if name.startswith("photons.")}
    assert 30_000 < packed_bytes(light) < 60_000
    assert re.match(r"This page holds the light of [\d,]+ photons, not of the 4,000", page.head["notes"][0])


def test_where_no_light_falls_there_is_no_page() -> None:
    dark = ss.Scene(BALL | {"objects": BALL["objects"][1:]})
    with pytest.raises(UserError, match="no caustic"):
        ss.page(dark, "table", size=(32, 18), photons=1000)


def test_coarse_meshes_keep_their_size() -> None:
    mesh = ss.Scene(BALL)._model.objects[0].mesh
    vertices, triangles = decimated(mesh.vertices, mesh.triangles, 600)
    assert 100 < len(triangles) <= 600
    assert np.allclose(np.ptp(vertices, axis=0), np.ptp(mesh.vertices, axis=0), rtol=0.1)
