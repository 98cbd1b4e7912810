"""The documents as a static site: `make site`.

`document` reads spec.md and `markdown` any document; `equations` sets its equations, `references` finds and links what has an id, `syntax`
and `glance` draw the syntax, `search` makes the index, `page` puts pages together and `build` writes them all.
"""
