# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Pieces of HTML: pages that hold all they show."""

from base64 import b64encode
from html import escape

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #222; background: #fff; max-width: 1100px;
       margin: 2em auto; padding: 0 1em; }
h1 { line-height: 1.2; } h2 { margin-top: 2.2em; border-bottom: 2px solid #222; }
table { border-collapse: collapse; margin: 1em 0; font-size: 14.5px; line-height: 1.35; }
th, td { text-align: left; vertical-align: top; padding: .4em .8em .4em 0;
         border-bottom: 1px solid #ddd; }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
tr.new td { border-top: 2px solid #aaa; }
code { font-size: 92%; white-space: nowrap; }
.natures td:nth-child(-n+4) { white-space: nowrap; }
figure { margin: 2em 0; } figure img { width: 100%; height: auto; }
figcaption { color: #444; font-size: 15px; }
.v { white-space: nowrap; font-weight: 600; }
.found { color: #1b7a34; } .part { color: #9a6400; }
.not { color: #b3261e; } .silent { color: #666; }
"""


def table(head, rows, numbers=(), kind='plain'):
    """Return a table; cells are HTML; a row that begins anew is marked by None before it."""
    def cells(tag, row):
        return ''.join(f'<{tag} class="n">{cell}</{tag}>' if n in numbers else
                       f'<{tag}>{cell}</{tag}>' for n, cell in enumerate(row))
    lines, new = [f'<tr>{cells("th", head)}</tr>'], ''
    for row in rows:
        if row is None:
            new = ' class="new"'
        else:
            lines.append(f'<tr{new}>{cells("td", row)}</tr>')
            new = ''
    return f'<table class="{kind}">\n' + '\n'.join(lines) + '\n</table>\n'


def code(text):
    return f'<code>{escape(text)}</code>'


def figure(name, image, caption):
    return (f'<figure id="{name.removesuffix(".png")}"><a href="{name}"><img alt="{name}" '
            f'src="data:image/png;base64,{b64encode(image).decode()}"></a>\n'
            f'<figcaption>{escape(" ".join(caption.split()))}</figcaption></figure>\n')


def document(title, body):
    """Return a page as text."""
    return ('<!doctype html>\n<html lang="en"><head><meta charset="utf-8">\n'
            '<meta name="viewport" content="width=device-width">\n'
            f'<title>{title}</title>\n<style>{STYLE}</style></head>\n'
            f'<body>\n{body}</body></html>\n')
