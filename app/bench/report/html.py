"""The little HTML that the bench report needs: elements that escape every text by construction, tables, and the page's
look.

The page stands alone: its style is inside, it holds no script, and nothing is fetched.
"""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence

from .style import css_variables


class Html(str):
    """Text that is HTML already; everything else is escaped."""

    __slots__ = ()


_VOID = frozenset({"img", "br", "hr", "meta"})


def element(tag: str, *children: object, **attributes: object) -> Html:
    """<tag …>children</tag>. Children: `Html` as it is, None nothing, a list its items, anything else as escaped text.

    Attributes: `cls` is class, underscores become hyphens, None leaves one out.
    """
    names = {"cls": "class"}
    written = "".join(
        f' {names.get(key, key.replace("_", "-"))}="{html.escape(str(value), quote=True)}"'
        for key, value in attributes.items()
        if value is not None
    )
    if tag in _VOID:
        return Html(f"<{tag}{written}>")
    return Html(f"<{tag}{written}>{''.join(_text(child) for child in children)}</{tag}>")


def _text(child: object) -> str:
    if child is None:
        return ""
    if isinstance(child, Html):
        return child
    if isinstance(child, str):
        return html.escape(child)
    if isinstance(child, Iterable):
        return "".join(_text(item) for item in child)
    return html.escape(str(child))


def table(headings: Sequence[object], rows: Iterable[Sequence[object]], caption: object = None, left: int = 1) -> Html:
    """A table whose first `left` columns are flush left and the others numbers, flush right; it scrolls where it is too
    wide.

    The first cell of each row is its heading.
    """

    def cell(tag: str, index: int, content: object, **more: object) -> Html:
        return element(tag, content, cls="n" if index >= left else None, **more)

    head = element("tr", [cell("th", i, heading, scope="col") for i, heading in enumerate(headings)])
    body = [
        element(
            "tr",
            [
                cell("th" if i == 0 else "td", i, content, scope="row" if i == 0 else None)
                for i, content in enumerate(row)
            ],
        )
        for row in rows
    ]
    inner = element(
        "table", element("caption", caption) if caption else None, element("thead", head), element("tbody", body)
    )
    return element("div", inner, cls="wide")


def figure(content: object, caption: object = None, size: str | None = None) -> Html:
    """A figure with its caption; size: "half" or "most" of the page's width, None: all there is."""
    return element("figure", content, element("figcaption", caption) if caption else None, cls=size)


def page(title: str, body: object) -> Html:
    """A whole document."""
    head = element(
        "head",
        element("meta", charset="utf-8"),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("title", title),
        element("style", Html(css_variables() + _CSS)),
    )
    return Html("<!doctype html>\n" + element("html", head, "\n", element("body", body), lang="en-GB") + "\n")


_CSS = """
*{box-sizing:border-box}
body{margin:0 auto;max-width:86rem;padding:2rem clamp(1rem,3vw,3rem) 4rem;background:var(--paper);color:var(--ink);
  font:1rem/1.5 system-ui,-apple-system,"Segoe UI","DejaVu Sans",sans-serif;font-variant-numeric:tabular-nums}
h1{font-size:2rem;line-height:1.15;margin:.2rem 0 .4rem;letter-spacing:-.01em}
h2{font-size:1.4rem;margin:3rem 0 .6rem;padding-top:.8rem;border-top:2px solid var(--ink)}
h3{font-size:1.05rem;margin:1.8rem 0 .4rem}
p,li,dd{max-width:75ch}
p{margin:.5rem 0}
a{color:inherit}
.lead{font-size:1.1rem}
.muted,figcaption,caption{color:var(--muted);font-size:.875rem}
figcaption{max-width:90ch;margin-top:.3rem}
figure{margin:1rem 0}
figure svg{width:100%;height:auto;display:block}
figure.measured_pass{max-width:42rem}
figure.most{max-width:62rem}
pre{background:var(--wash);padding:.7rem .9rem;overflow-x:auto;white-space:pre-wrap;overflow-wrap:anywhere;border-radius:4px;font-size:.9rem}
nav ul{display:flex;flex-wrap:wrap;gap:.2rem 1.1rem;list-style:none;padding:0;margin:1rem 0}
.wide{overflow-x:auto;margin:.8rem 0}
table{border-collapse:collapse;font-size:.875rem;line-height:1.4}
caption{text-align:left;padding-bottom:.3rem}
th,td{padding:.3rem .8rem .3rem 0;text-align:left;vertical-align:top;border-bottom:1px solid var(--grid)}
thead th{color:var(--muted);font-weight:500;border-bottom:1px solid var(--muted);vertical-align:bottom}
tbody th{font-weight:500}
th.n,td.n{text-align:right;padding-left:.4rem}
td.n{white-space:nowrap}
table.claims{width:100%}
table.claims td:nth-last-child(2){white-space:nowrap}
.yes{color:var(--good);font-weight:600}
.no{color:var(--bad);font-weight:600}
.srd{color:var(--srd);font-weight:700}
.facts{columns:26rem;column-gap:2.5rem;font-size:.9rem;margin:1rem 0}
.facts div{display:grid;grid-template-columns:6.5rem 1fr;gap:1rem;break-inside:avoid;padding:.08rem 0}
.facts dt{color:var(--muted)}
.facts dd,.terms dd{margin:0}
.terms dt{font-weight:600;margin-top:.5rem}
.terms{font-size:.9rem}
.two{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(28rem,100%),1fr));gap:0 2.5rem}
.warning{border-left:4px solid var(--bad);background:var(--wash);padding:.5rem .9rem;margin:.8rem 0}
.warning p{margin:.2rem 0}
table.pictures{border-collapse:separate;border-spacing:.5rem .35rem;margin-left:-.5rem;table-layout:fixed;width:100%;min-width:62rem}
table.pictures th,table.pictures td{border:0;padding:0;vertical-align:top}
table.pictures .row{width:5.6rem;color:var(--muted);font-weight:500;font-size:.8rem}
table.pictures thead th{color:var(--ink);font-weight:600}
table.pictures thead th.srd{color:var(--srd)}
table.pictures img{display:block;width:100%;height:auto;background:#000}
img.crop{image-rendering:pixelated}
.numbers{font-size:.78rem;line-height:1.35;margin-top:.15rem}
.missing{display:block;background:var(--wash);color:var(--muted);font-size:.8rem;padding:.6rem}
.framed{position:relative;display:block}
.framed i{position:absolute;border:1.5px solid #fff;outline:1px solid #000}
.scale{max-width:26rem;margin:.5rem 0;font-size:.8rem}
.scale img{display:block;width:100%;height:.8rem;image-rendering:auto}
.scale div{display:flex;justify-content:space-between}
@media print{
  @page{size:A4 landscape;margin:12mm}
  html{font-size:10.5px}
  body{max-width:none;padding:0}
  h2{break-before:page;margin-top:0}
  h2.flow{break-before:auto;margin-top:1.5rem}
  h2,h3{break-after:avoid}
  figure,tr,.warning,.scale,dl div,.wide:not(:has(.claims)){break-inside:avoid}
  dt{break-after:avoid}
  .wide{overflow:visible}
  table.pictures{min-width:0}
  nav{display:none}
  img,svg,.wash{print-color-adjust:exact;-webkit-print-color-adjust:exact}
}
"""
